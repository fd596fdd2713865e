"""What joins the parts of an object between which nothing is seen.

Seen from its side, a doll is a head, an arm and a leg far from each other: without what joins them its legs
would fall to the ground. One object hangs together.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.neighbours import hanging_together, pairs_within
from model.types import Array

APART = 0.6
"""Spacings: no point of a bridge is nearer to another point."""


def bridged(
    points: Float64[Array, "P 3"], reach: float, least: int, spacing: float
) -> tuple[Float64[Array, "Q 3"], Int64[Array, "E 2"]]:
    """The points and, behind them, those of bridges that make of all one body; and the pairs that are joined.

    The two parts that are nearest to each other are joined first, along straight lines from where they face
    each other.

    Args:
        points: Of the body [m].
        reach: How far points are joined [m].
        least: Neighbours that every point is joined to, however far.
        spacing: Of the points [m].
    """
    while True:
        pairs = pairs_within(points, reach, least)
        part = hanging_together(pairs, len(points))
        if part.max() == 0:
            return points, pairs
        more = _bridge(points, part == _nearest(points, part), spacing)
        if not len(more):
            return points, pairs
        points = np.concatenate([points, more])


def _nearest(points: Float64[Array, "P 3"], part: Int64[Array, " P"]) -> int:
    """The part that is nearest to another one."""
    return min(range(part.max() + 1), key=lambda each: float(_away(points, part == each)[0].min()))


def _away(
    points: Float64[Array, "P 3"], own: Bool[Array, " P"]
) -> tuple[Float64[Array, " n"], Int64[Array, " n"]]:
    """Of its own points how far the rest is [m], and which of it is nearest."""
    distance, index = cKDTree(points[~own]).query(points[own])
    return distance, np.flatnonzero(~own)[index].astype(np.int64)


def _bridge(points: Float64[Array, "P 3"], own: Bool[Array, " P"], spacing: float) -> Float64[Array, "B 3"]:
    """New points on lines from a part to what it faces."""
    away, other = _away(points, own)
    facing = away <= away.min() + spacing
    starts, ends = points[own][facing], points[other[facing]]
    steps = int(np.ceil(away[facing].max() / spacing))
    share = np.arange(1, steps)[:, None, None] / steps
    kept = [*points]
    for place in (starts + share * (ends - starts)).reshape(-1, 3):
        if np.linalg.norm(np.asarray(kept) - place, axis=1).min() >= APART * spacing:
            kept.append(place)
    made: Float64[Array, "B 3"] = np.asarray(kept)[len(points) :].reshape(-1, 3)
    return made
