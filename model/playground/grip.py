"""A point of the object that the user can hold."""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float64, Int
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.types import Array

PATCH = 12
"""Points that a hold is spread over, at most: one alone would be pulled out of the surface."""
REACH = 1.6
"""How far these are from the one clicked, in lengths of a spring."""
SAG = 0.01
"""How far [m] the weight of the whole object may stretch a hold."""
LAG = 0.04
"""Time [s] in which a hold makes up two thirds of its way to the pointer: the browser tells it in jumps."""
SIGHT = 2.5
"""How far beside the line of sight a point may lie to be meant, in lengths of a spring."""


@dataclass(frozen=True, eq=False)  # arrays have no one answer to whether they are equal
class Grip:
    """A control point: rides along on the object, or holds it where the user has it."""

    number: int
    point: int
    """The mass point that was clicked."""
    points: Int[Array, " k"]
    """Those that are held with it."""
    offsets: Float64[Array, "k 3"]
    """Where they are, from the place of the grip [m]."""
    stiffness: Float64[Array, " k"]
    """With which they are held [N/m]."""
    place: Float64[Array, " 3"]
    """Where it is [m]."""
    target: Float64[Array, " 3"]
    """Where it is going [m]."""
    dragged: bool = False
    pinned: bool = False

    @property
    def holds(self) -> bool:
        """It holds the object, and does not just ride along."""
        return self.dragged or self.pinned

    @property
    def places(self) -> Float64[Array, "k 3"]:
        """Where the held points are drawn to [m]."""
        places: Float64[Array, "k 3"] = self.place + self.offsets
        return places

    def later(self, interval: float, positions: Float[Array, "N 3"]) -> "Grip":
        """The grip after `interval` [s], the points being at `positions` [m] before."""
        if not self.holds:
            here = positions[self.point].astype(np.float64)
            return replace(self, place=here, target=here)
        share = 1.0 - math.exp(-interval / LAG)
        return replace(self, place=self.place + share * (self.target - self.place))

    def taking_hold(self, positions: Float[Array, "N 3"]) -> "Grip":
        """The grip around the points as they are at `positions` [m]."""
        here = positions[self.point].astype(np.float64)
        offsets = positions[self.points].astype(np.float64) - here
        return replace(self, place=here, target=here, offsets=offsets)


def grip_on(number: int, point: int, bundle: TwinBundle, positions: Float[Array, "N 3"]) -> Grip:
    """A grip on a mass point and those around it, as firm as the object itself is there.

    Firmer would ask for more substeps; softer must still carry the object.
    """
    topology = bundle.topology
    reach = REACH * spring_length(bundle)
    distance, near = cKDTree(topology.points).query(
        topology.points[point], k=min(PATCH, len(topology.points))
    )
    distance, near = np.atleast_1d(distance), np.atleast_1d(near)
    points = near[distance <= reach].astype(np.int64)
    around = np.zeros(len(topology.points))
    for end in (0, 1):
        np.add.at(around, topology.springs[:, end], bundle.parameters.stiffness)
    stiffness = around[points]
    carrying = 9.81 * float(topology.mass.sum()) / SAG
    if not stiffness.any():
        stiffness = np.full(len(points), carrying / len(points))
    stiffness *= max(1.0, carrying / max(stiffness.sum(), 1e-12))
    here = positions[point].astype(np.float64)
    offsets = positions[points].astype(np.float64) - here
    return Grip(number, point, points, offsets, np.maximum(stiffness, 1e-6), here, here)


def pick(
    positions: Float[Array, "N 3"],
    origin: Float[Array, " 3"],
    direction: Float[Array, " 3"],
    spacing: float,
) -> int | None:
    """The point of the object that is meant by a line of sight: of those beside it the nearest to the eye.

    Args:
        positions: Of the mass points [m].
        origin: Of the line [m].
        direction: Of the line.
        spacing: Length of a spring [m].

    Returns:
        Its index, or None where the line misses the object.
    """
    way = direction / np.linalg.norm(direction)
    depth = (positions - origin) @ way
    beside = np.linalg.norm(positions - origin - depth[:, None] * way, axis=1)
    beside = np.where(depth > 0, beside, np.inf)
    nearest = float(beside.min())
    if nearest > SIGHT * spacing:
        return None
    meant = beside <= max(nearest, spacing)
    return int(np.where(meant, depth, np.inf).argmin())


def spring_length(bundle: TwinBundle) -> float:
    """The usual length of a spring [m]; a tenth of the object where there is none."""
    lengths = bundle.topology.rest_length
    if len(lengths):
        return float(np.median(lengths))
    return 0.1 * float(np.ptp(bundle.topology.points, axis=0).max())
