"""Roll exported twins out in MuJoCo and Newton under their recorded motion, and compare with ours.

    python benchmarks/exports/run.py [CLIP ...] [--twins DIR] [--procedural] [--coarse N]

Without names, the procedural twins and the real clips `CLIPS`. A clip is
turned into a twin first (`matphys twin`), unless DIR has it. The real clips are in `$MATPHYS_DATA/videos`.
Each export is run by the script that it carries, in a process of its own, as its user would; MuJoCo's with
the twin's impact on the ground, as it comes, and with MuJoCo's own contact. Prints a Markdown table; a
deviation above its bar is marked and makes the exit status 1. The lively block is there to show how far
MuJoCo's own contact goes, and has no bar there.
"""

import argparse
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from parity import OWN_CONTACT, SCRIPTS, compare
from procedural import SHAPES

from model.bundle import TwinBundle
from model.exports.coarsen import coarsen
from model.exports.mechanics import roll

CLIPS = ("single_lift_rope", "double_lift_cloth_1", "single_lift_sloth")
LIVELY = "solid, falling, restitution 0.5"
HANGING = {"mujoco": 1e-4, "newton": 5e-4}
"""Bars [m] where nothing comes near the ground."""
CONTACT = 5e-3
"""The bar [m] where something does."""
NEAR = 1e-3
"""A point that comes so near to the ground [m] is in contact."""


def data_folder() -> Path:
    """Where the real clips are, or exit with one line that says they are absent."""
    default = Path(__file__).resolve().parents[2] / ".." / "shared" / "data"
    folder = Path(os.environ.get("MATPHYS_DATA", default)) / "videos"
    if not folder.is_dir():
        sys.exit(f"no real clips at {folder}: set MATPHYS_DATA to the folder that holds videos/")
    return folder


def real_twin(clip: str, folder: Path) -> TwinBundle:
    """The twin of a clip, made where it is not there yet."""
    path = folder / f"{clip}.twin.zip"
    if not path.exists():
        matphys = Path(sys.executable).parent / "matphys"
        video = data_folder() / f"{clip}.mp4"
        subprocess.run([str(matphys), "twin", str(video), "--out", str(path), "--quiet"], check=True)
    return TwinBundle.load(path)


def twins(clips: list[str], folder: Path, procedural: bool) -> Iterator[tuple[str, TwinBundle]]:
    """Name and twin, one after the other."""
    if procedural:
        for name, make in SHAPES.items():
            yield f"{name}, hanging", make()
            yield f"{name}, falling", make(ground=True)
        yield LIVELY, SHAPES["solid"](ground=True, restitution=0.5)
    for clip in clips:
        yield clip, real_twin(clip, folder)


def motion_of(twin: TwinBundle) -> str:
    """Whether anything comes near the ground."""
    ground = twin.parameters.globals.get("ground_height")
    if ground is None or roll(twin).points[..., 2].min() > float(ground.value) + NEAR:
        return "hanging"
    return "contact"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="*", help="names without .mp4")
    parser.add_argument("--twins", type=Path, default=Path("out/exports"), help="where twins and exports go")
    parser.add_argument("--procedural", action="store_true", help="the procedural twins, with clips or alone")
    parser.add_argument(
        "--coarse", type=int, metavar="N", help="also each larger twin, coarsened to N points"
    )
    arguments = parser.parse_args()
    alone = not arguments.clips and not arguments.procedural
    clips = arguments.clips or (list(CLIPS) if alone else [])
    arguments.twins.mkdir(parents=True, exist_ok=True)
    columns = ("twin", "points / springs", "simulator", "motion", "max mm", "mean mm", "bar mm")
    columns += ("moves up to mm", "s of motion", "s taken")
    print("| " + " | ".join(columns) + " |")
    print("|---" * len(columns) + "|")
    within, notes = True, []
    for name, twin in twins(clips, arguments.twins, alone or arguments.procedural):
        cases = [(name, twin)]
        if arguments.coarse and len(twin.topology.points) > arguments.coarse:
            small = coarsen(twin, arguments.coarse)
            notes.append(f"{name}: {small.statement}")
            cases.append((f"{name}, coarse", small.twin))
        for title, case in cases:
            within &= _rows(title, case, arguments.twins)
    print("", *notes, sep="\n")
    sys.exit(0 if within else 1)


def bar_of(name: str, simulator: str, motion: str) -> float:
    """How far the two may be apart [m]."""
    if motion == "hanging":
        return HANGING[simulator]
    return math.inf if (name, simulator) == (LIVELY, OWN_CONTACT) else CONTACT


def _rows(name: str, twin: TwinBundle, folder: Path) -> bool:
    motion, length = motion_of(twin), float(roll(twin).times[-1])
    counts = f"{len(twin.topology.points)} / {len(twin.topology.springs)}"
    within = True
    for simulator in SCRIPTS:
        if simulator == OWN_CONTACT and motion == "hanging":
            continue
        out = folder / f"{name}.{simulator}".replace(", ", "-").replace(" ", "_")
        parity, bar = compare(twin, simulator, out), bar_of(name, simulator, motion)
        fits = parity.maximum <= bar
        within &= fits
        mark = "" if fits else " **!**"
        print(
            f"| {name} | {counts} | {simulator} | {motion} | {1e3 * parity.maximum:.2g}{mark} | "
            f"{1e3 * parity.mean:.2g} | {f'{1e3 * bar:g}' if math.isfinite(bar) else 'none'} | "
            f"{1e3 * parity.travel:.0f} | {length:.2f} | {parity.seconds:.1f} |",
            flush=True,
        )
    return within


if __name__ == "__main__":
    main()
