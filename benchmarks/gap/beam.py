"""A real beam: the twin is fitted without its load and foretells what it does with it.

    python -m benchmarks.gap.beam --out out/beam

Reads `beam` of `$MATPHYS_DATA` (default `../shared/data`): motion capture of a silicone cantilever, three
markers at its tip, three at its clamp, held straight and let go, without a load and with one at the tip. What
comes before it is let go is left out, for what holds it there is not recorded, and the clamp is taken to be
at rest, for one of its markers slips in the loaded recording. The twin is made of one
recording without a load. It is compared with that one, with its repetition, and with the loaded one: as it
is, and with the load that was hung there, known by its weight. Then the loaded recording is diagnosed with
the unloaded twin. Writes reports, `beam.md` and `beam.png`.
"""

import argparse
import os
import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from benchmarks.gap.beam_figure import Line, draw, tip
from benchmarks.gap.beam_twin import added, elsewhere, foretold, load_found
from benchmarks.gap.cantilever import GRAVITY, Cantilever
from benchmarks.gap.swing import LOOKED_AT, Swing, swing
from model.formats.npz import read_arrays
from model.gap.bodies.let_go import after_let_go
from model.gap.diagnose import diagnose
from model.gap.diagnosis import Diagnosis
from model.gap.effects.mass_heterogeneity import MassHeterogeneity
from model.gap.given import given_twin
from model.gap.report.style import png
from model.gap.report.write import write_report
from model.gap.study import Study, study
from model.gap.write_back import twin_of
from model.observation import read_observation
from model.simulator.kernel.threads import kernel_threads, usable_cores
from model.types import Array, Observation

FIRST, AGAIN, LOADED = "beam_gravity_a", "beam_gravity_b", "beam_load52_a"
KEYS = ("tip_load_N", "density", "beam_size_m")


@dataclass(frozen=True)
class Recording:
    """One of the files."""

    seen: Observation
    """From when it is let go on."""
    left_out: int
    """Frames before that."""
    load: float
    """At the tip, in metres of beam."""
    per_metre: float
    """Mass of the beam [kg/m]."""

    @classmethod
    def read(cls, path: Path) -> "Recording":
        """With what only these files have."""
        whole, about = read_observation(path), read_arrays(path, KEYS)
        per_metre = float(about["density"] * np.prod(about["beam_size_m"][1:]))
        load = float(about["tip_load_N"]) / GRAVITY / per_metre
        seen = after_let_go(whole)
        return cls(seen, len(whole.times) - len(seen.times), load, per_metre)

    def at_rest(self) -> "Recording":
        """With a clamp that does not move: it is bolted, and one of its markers slips in one recording."""
        still = np.repeat(self.seen.controllers[:1], len(self.seen.times), 0)
        return replace(self, seen=replace(self.seen, controllers=still))

    @property
    def places(self) -> Float64[Array, "T N 3"]:
        """Of the markers [m]."""
        return self.seen.points.astype(np.float64)


@dataclass(frozen=True)
class Row:
    """What the tip does, and how far that is from what was seen."""

    name: str
    swing: Swing
    error: float | None = None
    """Mean distance of the markers over the first second [m]."""

    def __str__(self) -> str:
        """A row of the table."""
        one = self.swing
        error = "–" if self.error is None else f"{1e3 * self.error:.2f}"
        return f"| {self.name} | {1e3 * one.drop:.1f} | {one.period:.3f} | {one.damping:.3f} | {error} |"


def row(name: str, recording: Recording, points: Float64[Array, "T N 3"] | None = None) -> Row:
    """Of places that were foretold; None: of the recording itself."""
    times, places = recording.seen.times, recording.places
    found = swing(times, (places if points is None else points)[..., 2].mean(1))
    return Row(name, found, None if points is None else error(places, points, times))


def error(
    seen: Float64[Array, "T N 3"], other: Float64[Array, "S N 3"], times: Float64[Array, " T"]
) -> float:
    """Mean distance of the markers over the first second, each from where it was let go [m]."""
    count = min(int(np.searchsorted(times, times[0] + LOOKED_AT)), len(other))
    way = (seen - seen[0])[:count] - (other - other[0])[:count]
    return float(np.nanmean(np.linalg.norm(way, axis=-1)))


def closed_form(name: str, load: float) -> Row:
    """Of Euler and Bernoulli, with the modulus that the data's README names."""
    beam = Cantilever(load=load)
    return Row(name, Swing(beam.drop, beam.period, beam.damping))


def told(name: str, found: Diagnosis, spent: float) -> str:
    """What a diagnosis says, a row of the table."""
    report = found.findings.report
    gap = report.gap
    numbers = [gap.baseline, gap.refit, gap.with_effect]
    cells = [
        name,
        report.verdict.effect,
        f"{report.verdict.probability:.2f}",
        ", ".join(f"{one.name} {one.probability:.2f}" for one in report.effects[:3]),
        *("–" if value is None else f"{1e3 * value:.2f}" for value in numbers),
        "–" if gap.closed_fraction is None else f"{gap.closed_fraction:.2f}",
        f"{spent:.0f}",
    ]
    return "| " + " | ".join(cells) + " |"


def compared(
    first: Recording, again: Recording, loaded: Recording, fitted: Study
) -> tuple[list[Row], list[str], Mapping[str, Mapping[str, Line]]]:
    """Rows, words and lines of what the twin foretells."""
    grams, still = 1e3 * first.per_metre, loaded.at_rest()
    there = elsewhere(fitted, still.seen)
    load = load_found(fitted, there)
    own, without = foretold(fitted, fitted.plain.twin), foretold(fitted, there)
    known = foretold(fitted, there, loaded.load)
    best = foretold(fitted, there, load)
    weight = f"{grams * loaded.load:.0f} g"
    rows = [
        row("no load: seen", first),
        replace(row("seen again", again), error=error(first.places, again.places, first.seen.times)),
        row("twin, fitted to it", first, own),
        row("twin, in the repetition", again, foretold(fitted, elsewhere(fitted, again.at_rest().seen))),
        closed_form("Euler and Bernoulli, 264 kPa", 0.0),
        row("load: seen", loaded),
        row("twin that knows of no load", loaded, without),
        row(f"twin with the known load, {weight}", loaded, known),
        row(
            "the same, clamp as recorded",
            loaded,
            foretold(fitted, elsewhere(fitted, loaded.seen), loaded.load),
        ),
        row(f"twin with the load that fits best, {grams * load:.0f} g", loaded, best),
        closed_form("Euler and Bernoulli, 264 kPa", first.per_metre * loaded.load),
    ]
    words = [
        f"frames left out before it is let go: {first.left_out}, {again.left_out}, {loaded.left_out}",
        f"the twin is {len(fitted.plain.twin.body.points)} mass points; {grams * load:.1f} g at its tip "
        f"fit the loaded recording best, its own parameters kept; {grams * loaded.load:.1f} g hung there",
    ]
    times = loaded.seen.times
    panels = {
        "no load": {
            "observed": tip(first.seen.times, first.places),
            "observed again": tip(again.seen.times, again.places),
            "twin": tip(first.seen.times, own),
        },
        f"{weight} at the tip": {
            "observed": tip(times, loaded.places),
            "twin without the load": tip(times, without),
            "twin with the known load": tip(times, known),
            "twin with the load that fits": tip(times, best),
        },
    }
    return rows, words, panels


def main(arguments: list[str] | None = None) -> int:
    """Print the tables and write them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="for tables, figure and reports")
    parser.add_argument("--foretold", action="store_true", help="what the twin foretells, no diagnoses")
    options = parser.parse_args(arguments)
    data = Path(os.environ.get("MATPHYS_DATA", "../shared/data")) / "beam"
    if not data.is_dir():
        print(f"{data} is absent: set MATPHYS_DATA to the folder of recordings", file=sys.stderr)
        return 2
    warnings.simplefilter("ignore")
    options.out.mkdir(parents=True, exist_ok=True)
    first, again, loaded = (Recording.read(data / f"{name}.npz") for name in (FIRST, AGAIN, LOADED))
    with kernel_threads(usable_cores()):
        fitted = study(first.at_rest().seen)
        rows, words, panels = compared(first, again, loaded, fitted)
    (options.out / "beam.png").write_bytes(png(draw(panels)))
    lines = ["| | drop mm | period s | damping | error mm |", "|---" * 5 + "|", *map(str, rows), "", *words]
    print("\n".join(lines), flush=True)
    if not options.foretold:
        lines += ["", *diagnoses(first, loaded, fitted, options.out)]
    (options.out / "beam.md").write_text("\n".join(lines) + "\n")
    return 0


def diagnoses(first: Recording, loaded: Recording, fitted: Study, out: Path) -> list[str]:
    """The unloaded recording with the loaded one as the other, and the loaded one with the unloaded twin."""
    lines = [
        "| | verdict | probability | likeliest effects | baseline | refit | with effect | closed | s |",
        "|---" * 9 + "|",
    ]
    began = time.monotonic()
    first, loaded = first.at_rest(), loaded.at_rest()
    found = diagnose(first.seen, None, loaded.seen)
    lines.append(told("no load; the loaded one to confirm", found, time.monotonic() - began))
    write_report(found.findings, out / "unloaded")
    twin = twin_of(first.seen, replace(found, effects=(), fitted=fitted.base.values), fitted.plain.twin)
    twin.save(out / "unloaded.twin.zip")
    given = given_twin(twin, loaded.seen)
    began = time.monotonic()
    found = diagnose(given.observation, given)
    lines.append(told("load, with the unloaded twin", found, time.monotonic() - began))
    write_report(found.findings, out / "loaded")
    load = next(one for one in found.findings.report.effects if one.name == MassHeterogeneity.name)
    if load.parameters:
        values = {f"{load.name}.{name}": one.value for name, one in load.parameters.items()}
        load, where = added(given, values)
        lines += ["", f"its load: {1e3 * first.per_metre * load:.1f} g at {where:.2f} of the length"]
    print("\n".join(["", *lines]), flush=True)
    return lines


if __name__ == "__main__":
    sys.exit(main())
