"""Whether bodies made of what is seen are as hard to turn as the objects themselves.

    python -m benchmarks.gap.gyration --count 24

Objects of the development and test recipes (`benchmarks/reality/recipe.py`), alike everywhere, at rest,
their surface seen with a millimetre of noise. Prints, for each kind, the median over objects of the body's
radii of gyration over the true ones, longest axes first: with its shares of mass, and were all points as
heavy; and how far its middle is from the true one, over the object's size.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from numpy.random import Generator

from benchmarks.reality.recipe import draw_recipe
from benchmarks.reality.shapes import Shape
from model.gap.bodies.body import Body, body_of
from model.types import Array, Observation

HEADER = "| kind | objects | gyration over the true one | were all as heavy | middle off |"
SEED, FRAMES, NOISE = 300, 20, 1e-3
INSIDE = 200_000
"""Places that are asked whether they are inside."""
AXES = {"rope": 1, "sheet": 2, "solid": 3}


def inside(shape: Shape, rng: Generator) -> Float64[Array, "n 3"]:
    """Places evenly in an object [m]."""
    if shape.kind == "rope":
        marks = np.linspace(0.0, 2.0, 4001)
        return shape.curve(np.linspace(0.0, marks[shape.inside(marks[:, None])].max(), 2000))
    low, high = shape.surface.min(0), shape.surface.max(0)
    margin = 0.1 * (high - low).max()
    places = rng.uniform(low - margin, high + margin, (INSIDE, 3))
    if shape.kind == "sheet":
        places[:, 2] = 0.0
    return places[shape.inside(places)]


def body_seen(shape: Shape, rng: Generator) -> Body:
    """The body of an object that lies still."""
    seen = np.repeat(shape.surface[None], FRAMES, 0) + rng.normal(0.0, NOISE, (1, *shape.surface.shape))
    return body_of(
        Observation(
            times=np.arange(FRAMES) / 30.0,
            points=seen.astype(np.float32),
            controllers=np.zeros((FRAMES, 0, 3), np.float32),
        )
    )


def gyration(places: Float64[Array, "n 3"], share: Float64[Array, " n"]) -> Float64[Array, "3"]:
    """Radii of gyration [m], the largest first."""
    away = places - share @ places
    return np.sqrt(np.linalg.eigvalsh((share[:, None] * away).T @ away).clip(0))[::-1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each kind of object."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=24, help="worlds of each recipe")
    count = parser.parse_args(arguments).count
    warnings.simplefilter("ignore")
    rows: dict[str, list[Float64[Array, " k"]]] = {}
    for split in ("dev", "test"):
        for index in range(count):
            shape = draw_recipe(SEED, split, index).world.shape
            rng = np.random.default_rng([SEED, index])
            body, true = body_seen(shape, rng), inside(shape, rng)
            if body.shape != shape.kind:
                continue
            points = body.points * [1.0, 1.0, 0.0] if shape.kind == "sheet" else body.points
            axes = AXES[shape.kind]
            wanted = gyration(true, np.full(len(true), 1.0 / len(true)))
            even = np.full(len(points), 1.0 / len(points))
            found = [gyration(points, share)[:axes] / wanted[:axes] for share in (body.share, even)]
            off = np.linalg.norm(body.share @ points - true.mean(0)) / np.linalg.norm(wanted)
            rows.setdefault(shape.kind, []).append(np.concatenate([*found, [off]]))
    print(f"{HEADER}\n{'|---' * (HEADER.count('|') - 1)}|")
    for kind, each in sorted(rows.items()):
        middle, axes = np.median(each, axis=0), AXES[kind]
        parts = (middle[:axes], middle[axes : 2 * axes], middle[-1:])
        told = " | ".join(", ".join(f"{one:.2f}" for one in part) for part in parts)
        print(f"| {kind} | {len(each)} | {told} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
