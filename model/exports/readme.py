"""The README that every export carries: units, frame, how to use it, what the format cannot express."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from model.version import __version__

if TYPE_CHECKING:
    from model.bundle import TwinBundle

FRAME = "World frame: right-handed, z up; metres, kilograms, seconds, newtons."


def write_readme(
    twin: "TwinBundle",
    title: str,
    *,
    files: Sequence[tuple[str, str]],
    frame: str = FRAME,
    use: Sequence[str] = (),
    limits: Sequence[str] = (),
) -> str:
    """The text, in Markdown.

    Args:
        twin: What was exported; what its bundle warns of is repeated.
        title: Of the format.
        files: Name of each file, and what it is.
        frame: Units and axes.
        use: How to use the files, a paragraph each.
        limits: What the format cannot express, or what is different in it, a line each.
    """
    topology, source = twin.topology, twin.manifest.source
    counts = (
        f"Twin `{twin.manifest.id}` of {source.name or 'an unnamed source'}, written by MatPhys "
        f"{__version__}: {len(topology.points)} points, {len(topology.springs)} springs, "
        f"{len(twin.gaussians)} Gaussians, "
        f"{len(topology.controller_points)} controllers, {float(topology.mass.sum()):.3g} kg."
    )
    sections = [
        f"# {title}\n\n{counts}",
        "## Files\n\n" + _list(f"`{name}`: {text}" for name, text in files),
        f"## Units and frame\n\n{frame}",
    ]
    if use:
        sections.append("## Use\n\n" + "\n\n".join(use))
    sections.append(
        "## What this format cannot express\n\n" + (_list(limits) if limits else "Nothing is lost.")
    )
    if twin.manifest.warnings:
        sections.append("## What the twin warns of\n\n" + _list(twin.manifest.warnings))
    return "\n\n".join(sections) + "\n"


def _list(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)
