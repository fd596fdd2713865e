"""How near a plain twin comes to worlds in which nothing is missing: what effects have to stand out from.

    python -m benchmarks.reality.generate --split dev --count 60 --seed 0 --out out/worlds/dev
    python -m benchmarks.gap.healthy out/worlds/dev

Of development worlds with plain labels: the noise that was put in, what the fitted twin's observer is
surprised by one frame ahead, and how far its free runs of 0.7 s are off in frames that no fit has seen.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.gap.development import healthy_worlds
from model.gap.benchmark.labels import Label
from model.gap.forecast import forecast
from model.gap.study import study
from model.observation import read_observation


@dataclass(frozen=True)
class Row:
    """One world; lengths in millimetres."""

    world: str
    object: str
    interaction: str
    noise: float
    moved: float
    """Mean distance from the first frame."""
    surprise: float
    """Root mean square of a coordinate's innovations."""
    free: float
    """Mean distance of free runs."""

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """In the order of the table."""
        return self.noise, self.moved, self.surprise, self.free


def measured(folder: Path, label: Label) -> Row:
    """Fit a plain twin to one world."""
    observation = read_observation(folder / f"{label['world']}.npz")
    fitted = study(observation)
    foretold = forecast(fitted.observer, fitted.plain.at(fitted.base.values), fitted.split)
    points = observation.points.astype(np.float64)
    moved = float(np.nanmean(np.linalg.norm(points - points[0], axis=-1)))
    surprise = math.sqrt(fitted.base.cost) * fitted.misfit.noise
    return Row(
        label["world"],
        label["kind"],
        label["interaction"],
        1e3 * label["noise_m"],
        1e3 * moved,
        1e3 * surprise,
        1e3 * foretold.error,
    )


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    folder, labels = healthy_worlds(__doc__, arguments)
    rows = []
    print("| world | object | interaction | noise mm | moved mm | surprise mm | free run mm |")
    print("|---" * 7 + "|")
    for label in labels:
        row = measured(folder, label)
        rows.append(row)
        numbers = " | ".join(f"{value:.1f}" for value in row.lengths)
        print(f"| {row.world} | {row.object} | {row.interaction} | {numbers} |", flush=True)
    for name in ("rope", "sheet", "solid"):
        some = [row.lengths for row in rows if row.object == name]
        if some:
            numbers = " | ".join(f"{value:.1f}" for value in np.median(some, axis=0))
            print(f"| median of {len(some)} | {name} | | {numbers} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
