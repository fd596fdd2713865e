"""How much the net of a plain sheet resists bending, against what it is meant to.

    python -m benchmarks.gap.bent_nets

A flat sheet is bent to a part of a cylinder. Energy per area over half the squared curvature is its flexural
rigidity. A net of mass points in regular triangles has it, wherever the tracked points are that it is made
of; of one whose points are those themselves, three that turn in its plane make no row: they bend out of it
by turning about their long side.
"""

import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from model.gap.bodies.body import LEAST, REACH, Body, between, body_of
from model.gap.bodies.neighbours import pairs_within, usual_distance
from model.gap.size import size_of
from model.gap.slight_bending import SLIGHT, slight_bending
from model.simulator.dynamics import Dynamics
from model.simulator.system import State, System
from model.types import Array, Observation

SIDE, SPACING = 0.33, 0.025
"""Of the sheet, and of the regular net's points [m]."""
WEIGHT = 2.0
"""[N]."""
CURVATURES = (0.5, 2.0, 6.0)
"""[1/m]: the largest is that of a cloth that hangs over a pillow."""
AROUND = 6
"""Directions in the plane, over half a turn."""


def regular() -> Float64[Array, "P 3"]:
    """Points in triangles of equal sides."""
    rows = int(SIDE / (SPACING * np.sqrt(0.75))) + 1
    columns = int(SIDE / SPACING)
    places = [
        (SPACING * (i + 0.5 * (j % 2)), SPACING * np.sqrt(0.75) * j, 0.0)
        for j in range(rows)
        for i in range(columns)
    ]
    return np.array(places)


def anywhere(seed: int, count: int = 180) -> Float64[Array, "P 3"]:
    """As many points by lot."""
    flat = np.random.default_rng(seed).uniform(0.0, SIDE, (count, 2))
    return np.column_stack([flat, np.zeros(count)])


def sheet_of(places: Float64[Array, "P 3"]) -> Body:
    """What is made of tracked points that lie flat."""
    points = np.repeat(places[None].astype(np.float32), 4, axis=0)
    body = body_of(Observation(np.arange(4) / 30.0, points, np.zeros((4, 0, 3), np.float32)), "sheet")
    flat = body.points.copy()
    flat[:, 2] = 0.0  # numbers of the file are rounded
    return replace(body, points=flat)


def themselves(places: Float64[Array, "P 3"]) -> Body:
    """A sheet whose mass points are those that are tracked."""
    spacing = usual_distance(places)
    springs = pairs_within(places, REACH["sheet"] * spacing, least=LEAST)
    share = np.full(len(places), 1.0 / len(places))
    index, weight = between(places, places)
    nothing = np.zeros((0, 2), np.int64)
    return Body("sheet", places, springs, share, index, weight, nothing, spacing)


def rigidity(body: Body, curvature: float) -> Float64[Array, " k"]:
    """Flexural rigidity [N·m] of a flat body bent about each of `AROUND` directions to a curvature [1/m]."""
    term = slight_bending(body, WEIGHT)
    assert term is not None
    area, found = float(ConvexHull(body.points[:, :2]).volume), []
    for angle in np.pi * np.arange(AROUND) / AROUND:
        along = body.points[:, 0] * np.cos(angle) + body.points[:, 1] * np.sin(angle)
        across = body.points[:, 1] * np.cos(angle) - body.points[:, 0] * np.sin(angle)
        lifted = 1.0 - np.cos(curvature * along)
        bent = np.stack([np.sin(curvature * along) / curvature, across, lifted / curvature], -1)
        points = torch.from_numpy(bent)
        nothing = torch.zeros((0, 2), dtype=torch.long)
        system = System(points=points, mass=1.0, springs=nothing, rest_length=torch.zeros(0))
        dynamics = Dynamics(system, [term], [])
        motion = dynamics.motion(State(points, torch.zeros_like(points)), None)
        energy = term.energy(motion, dynamics.forces[0][1])
        assert energy is not None
        found.append(float(energy) / (0.5 * area * curvature**2))
    return np.array(found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table."""
    if sys.argv[1:] if arguments is None else arguments:
        print("benchmarks.gap.bent_nets: takes no arguments", file=sys.stderr)
        return 2
    heads = " | ".join(f"{curvature:g} /m" for curvature in CURVATURES)
    print(f"| tracked | mass points | of them | meant [N·m] | {heads} |")
    print("|---" * (4 + len(CURVATURES)) + "|")
    tracked = [("in triangles", regular()), *((f"by lot, {seed}", anywhere(seed)) for seed in range(3))]
    for (name, places), (made, of) in itertools.product(
        tracked, (("ours", sheet_of), ("themselves", themselves))
    ):
        body = of(places)
        meant = SLIGHT["sheet"] * WEIGHT * size_of(body.points)
        mean = " | ".join(f"{rigidity(body, curvature).mean():.1e}" for curvature in CURVATURES)
        print(f"| {name} | {made} | {len(body.points)} | {meant:.1e} | {mean} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
