"""How near a plain twin comes to worlds in which nothing is missing: what effects have to stand out from.

    python -m benchmarks.reality.generate --split dev --count 60 --seed 0 --out out/worlds/dev
    python -m benchmarks.reality.generate --split dev --count 36 --seed 4 --only null --out out/worlds/null
    python -m benchmarks.gap.healthy out/worlds/dev out/worlds/null

Of development worlds with plain labels: the noise that was put in, what the fitted twin's observer is
surprised by one frame ahead, its square over the noise's as it is told (what is left), and how far free runs
of 0.7 s are off in frames that no fit has seen. The last lines have mean and standard deviation of the
logarithm of what is left, by which a verdict knows what is usual (`model/gap/weighing.py`).
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.gap.development import KINDS, healthy_worlds
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
    left: float
    """Mean square of these over the noise's, as it is told from the recording."""
    free: float
    """Mean distance of free runs."""

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """In the order of the table."""
        return self.noise, self.moved, self.surprise, self.left, self.free


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
        fitted.base.cost,
        1e3 * foretold.error,
    )


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    rows = []
    worlds = healthy_worlds(__doc__, arguments)
    print("| world | object | interaction | noise mm | moved mm | surprise mm | left | free run mm |")
    print("|---" * 8 + "|")
    for folder, label in worlds:
        row = measured(folder, label)
        rows.append(row)
        numbers = " | ".join(f"{value:.1f}" for value in row.numbers)
        print(f"| {row.world} | {row.object} | {row.interaction} | {numbers} |", flush=True)
    for name in KINDS:
        some = [row.numbers for row in rows if row.object == name]
        if some:
            numbers = " | ".join(f"{value:.1f}" for value in np.median(some, axis=0))
            print(f"| median of {len(some)} | {name} | | {numbers} |")
    for name in KINDS:
        left = np.log([row.left for row in rows if row.object == name])
        if len(left) > 1:
            print(f"{name}: ln of what is left {left.mean():.2f} ± {left.std(ddof=1):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
