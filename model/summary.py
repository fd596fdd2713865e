"""What is inside a twin: as tables for a reader, as plain data for a program."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from model.bundle import TwinBundle
from model.schema import PartRecord

PIPE_WIDTH = 110
"""Columns when the output is no terminal."""


def describe(twin: TwinBundle) -> dict[str, Any]:
    """The manifest, the counts and the mechanics of a twin, ready for JSON."""
    topology, manifest = twin.topology, twin.manifest.model_dump(mode="json", by_alias=True)
    extent = np.ptp(topology.points.astype(np.float64), axis=0)
    controls = 0 if twin.controls is None else len(twin.controls)
    return manifest | {
        "counts": {
            "gaussians": len(twin.gaussians),
            "points": len(topology.points),
            "springs": len(topology.springs),
            "parts": len(np.unique(topology.part)),
            "controllers": len(topology.controller_points),
            "controller_springs": len(topology.controller_springs),
            "control_frames": controls,
        },
        "mass": float(topology.mass.sum(dtype=np.float64)),
        "extent": [float(side) for side in extent],
        "stiffness": _statistics(twin.parameters.stiffness),
        "parameters": {
            name: {"value": entry.value, "unit": entry.unit, "source": entry.source, "std": entry.std}
            for name, entry in twin.parameters.globals.items()
        },
        "parts": [part.model_dump(mode="json", exclude={"overlay"}) for part in twin.parts],
        "effects": [effect.model_dump(mode="json", exclude={"acts_on"}) for effect in twin.effects],
        "preview_bytes": None if twin.preview is None else len(twin.preview),
    }


def print_twin(twin: TwinBundle) -> None:
    """Print tables of everything that `describe` tells."""
    console = make_console()
    facts = describe(twin)
    _print(console, "Twin", ("", ""), _overview(twin, facts))
    print_stages(twin, {}, console)
    if twin.parts:
        columns = ("part", "material", "stiffness of springs", "points", "mass", "extent")
        _print(console, "Parts", columns, [_part(part) for part in twin.parts])
    rows = [
        (name, _value(entry.value), entry.unit, entry.source, "" if entry.std is None else f"{entry.std:.3g}")
        for name, entry in twin.parameters.globals.items()
    ]
    _print(console, "Parameters", ("name", "value", "unit", "source", "std"), rows)
    if twin.manifest.metrics:
        metrics = [(name, _value(value)) for name, value in twin.manifest.metrics.items()]
        _print(console, "Metrics", ("name", "value"), metrics)
    if twin.effects:
        effects = [(effect.name, str(effect.parameters)) for effect in twin.effects]
        _print(console, "Effects", ("name", "parameters"), effects)
    if twin.manifest.warnings:
        _print(console, "Warnings", ("",), [(warning,) for warning in twin.manifest.warnings])


def print_stages(twin: TwinBundle, seconds: Mapping[str, float], console: Console | None = None) -> None:
    """Print which method served each stage and, where they were measured, the seconds it took."""
    stages = twin.manifest.stages
    if not stages:
        return
    # each by itself: a twin that was edited twice has two stages of a name
    timed = [seconds.get(stage.name, stage.seconds) for stage in stages]
    table = {
        "stage": [stage.name for stage in stages],
        "method": [stage.method or "" for stage in stages],
        "version": [stage.version or "" for stage in stages],
        "weights": [(stage.weights or "none")[:12] for stage in stages],
        "seconds": ["" if time is None else f"{time:.2f}" for time in timed],
        "warnings": [str(len(stage.warnings) or "") for stage in stages],
    }
    if not any(table["seconds"]):
        # a bundle is the same whoever made it, however fast: nothing of it is told in there
        del table["seconds"]
    _print(console or make_console(), "Stages", tuple(table), zip(*table.values(), strict=True))


def make_console() -> Console:
    """A console on stdout that does not cut tables at 80 columns when nobody is watching."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPE_WIDTH)


def _overview(twin: TwinBundle, facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    manifest, source, counts = twin.manifest, twin.manifest.source, facts["counts"]
    rows: list[tuple[str, object]] = [
        ("id", manifest.id),
        ("created", manifest.created),
        ("version", manifest.version),
        ("clip", source.name),
        ("sha256", source.sha256),
        ("frames", source.frames and f"{source.frames} at {source.fps or 0:.3g} fps"),
        ("image", source.width and f"{source.width} x {source.height} px"),
        ("keyframe", source.keyframe),
        ("camera", source.camera and source.camera.source),
        ("scale", source.scale),
        ("gravity", source.gravity),
        ("ground", source.ground),
        ("Gaussians", counts["gaussians"]),
        ("points", f"{counts['points']}, {facts['mass']:.3g} kg, {_extent(facts['extent'])}"),
        ("springs", f"{counts['springs']}, {_stiffness(facts['stiffness'])}"),
        ("controllers", f"{counts['controllers']} with {counts['controller_springs']} springs"),
        ("controls", f"{counts['control_frames']} frames" if counts["control_frames"] else "none"),
        ("preview", "none" if twin.preview is None else f"{len(twin.preview) / 1e6:.2f} MB"),
    ]
    return [(name, str(value)) for name, value in rows if value not in (None, "")]


def _part(part: PartRecord) -> tuple[str, ...]:
    likely = sorted(part.materials.items(), key=lambda item: -item[1])[:2]
    size, springs = part.size, part.stiffness
    known = springs is not None and springs.mean is not None and springs.std is not None
    return (
        str(part.label),
        ", ".join(f"{name} {share:.0%}" for name, share in likely),
        f"{springs.mean:.3g} ± {springs.std:.3g} N/m" if known and springs else "",
        "" if size is None else str(size.points),
        "" if size is None or size.mass is None else f"{1e3 * size.mass:.3g} g",
        "" if size is None or size.extent is None else _extent(size.extent),
    )


def _statistics(stiffness: np.ndarray) -> dict[str, float] | None:
    if not len(stiffness):
        return None
    values = stiffness.astype(np.float64)
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return {"median": float(middle), "p05": float(low), "p95": float(high)}


def _stiffness(statistics: Mapping[str, float] | None) -> str:
    if statistics is None:
        return "no stiffness"
    return f"{statistics['median']:.3g} N/m ({statistics['p05']:.3g} to {statistics['p95']:.3g})"


def _extent(extent: Iterable[float]) -> str:
    return " x ".join(f"{100 * side:.1f}" for side in extent) + " cm"


def _value(value: object) -> str:
    """A number short, a list of numbers by its mean."""
    if isinstance(value, tuple):
        return "(" + ", ".join(_value(item) for item in value) + ")"
    if isinstance(value, list) and value and all(isinstance(item, int | float) for item in value):
        return f"mean {np.mean(value):.4g} over {len(value)}"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _print(console: Console, title: str, columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    table = Table(title=title, title_justify="left", show_header=any(columns))
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        # A bundle is written by anyone: its text is neither markup nor a terminal's control codes.
        table.add_row(*(Text("".join(c if c.isprintable() else " " for c in cell)) for cell in row))
    console.print(table)
