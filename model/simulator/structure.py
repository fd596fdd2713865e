"""What the rest shape of a spring graph holds besides springs: rows of points, and cells of volume."""

import itertools

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import Delaunay, QhullError

from model.types import Array

STRAIGHTEST = np.cos(np.deg2rad(30.0))
"""Two springs that meet make a row where they turn by less than this."""
LONGEST = 2.0
"""Longest side of a cell, in spacings."""
NEAR = 1.5
"""Springs between neighbours are no longer than this, over how far a point usually is from its nearest."""
IN_LINE = 2
"""Neighbours of a point in a line."""
FEWEST = 3
"""Neighbours of which three always lie in a plane with a point: they say nothing of how thick it is."""
THINNEST = 0.2
"""A body is thin where neighbours are less far from a plane than this, of how far they are apart in it."""
FLATTEST = 0.02
"""Least volume of a cell, in cubed spacings: a regular tetrahedron has 0.118."""


def rows(points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"]) -> Int64[Array, "S 3"]:
    """Triples of neighbours in a row, the middle one second.

    Each spring end is continued by the spring that goes on most nearly straight, if any does so within 30°.
    Springs that reach over a neighbour make no row: they would bend along with those that do.

    Args:
        points: At rest [m].
        springs: Pairs of points.
    """
    springs = between_neighbours(points, springs)
    if not len(springs):
        return np.zeros((0, 3), np.int64)
    ends = np.concatenate([springs, springs[:, ::-1]])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    middle, other = ends[order, 0], ends[order, 1]
    way = points[other] - points[middle]
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    found: set[tuple[int, int, int]] = set()
    starts = np.searchsorted(middle, np.arange(len(points) + 1))
    for begin, end in itertools.pairwise(starts):
        if end - begin < 2:
            continue
        facing = -(way[begin:end] @ way[begin:end].T)
        best = facing.argmax(axis=1)
        for i in np.flatnonzero(facing.max(axis=1) >= STRAIGHTEST):
            pair = sorted((int(other[begin + i]), int(other[begin + best[i]])))
            found.add((pair[0], int(middle[begin]), pair[1]))
    return np.array(sorted(found), np.int64).reshape(-1, 3)


def between_neighbours(points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"]) -> Int64[Array, "F 2"]:
    """Springs of a graph without those that reach over a neighbour.

    Args:
        points: At rest [m].
        springs: Pairs of points.
    """
    if not len(springs):
        return springs
    length = np.linalg.norm(points[springs[:, 1]] - points[springs[:, 0]], axis=1)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, springs.ravel(), np.repeat(length, 2))
    near: Int64[Array, "F 2"] = springs[length <= NEAR * np.median(shortest[np.isfinite(shortest)])]
    return near


def faces(points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"]) -> Int64[Array, "F 3"]:
    """Triangles of springs between neighbours, as the net of a sheet has; none in what is thick or a line.

    Args:
        points: At rest [m].
        springs: Pairs of points.
    """
    near = np.sort(between_neighbours(points, springs), axis=1)
    if not _is_thin(points, near):
        return np.zeros((0, 3), np.int64)
    linked = np.zeros((len(points), len(points)), bool)
    linked[near[:, 0], near[:, 1]] = True
    edge, third = np.nonzero(linked[near[:, 0]] & linked[near[:, 1]])
    triangles = np.column_stack([near[edge], third])
    ordered: Int64[Array, "F 3"] = triangles[np.lexsort(triangles.T[::-1])]
    return ordered


def rows_of_line(points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"]) -> Int64[Array, "S 3"]:
    """Rows of what is a line, as `rows`; none in a sheet or in what is thick.

    Args:
        points: At rest [m].
        springs: Pairs of points.
    """
    return rows(points, springs) if is_line(points, springs) else np.zeros((0, 3), np.int64)


def is_line(points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"]) -> bool:
    """Whether most points have one neighbour before and one after them.

    Args:
        points: At rest [m].
        springs: Pairs of points.
    """
    near = between_neighbours(points, springs)
    joined = np.bincount(near.ravel(), minlength=len(points))
    return len(near) > 0 and bool(np.median(joined) <= IN_LINE)


def _is_thin(points: Float64[Array, "N 3"], near: Int64[Array, "F 2"]) -> bool:
    """Whether points and their neighbours mostly lie in planes: sheets do within 0.03, solids within 0.4."""
    ends = np.concatenate([near, near[:, ::-1], np.repeat(np.arange(len(points))[:, None], 2, axis=1)])
    count = np.bincount(ends[:, 0], minlength=len(points))
    middle = np.zeros((len(points), 3))
    np.add.at(middle, ends[:, 0], points[ends[:, 1]])
    away = points[ends[:, 1]] - (middle / count[:, None])[ends[:, 0]]
    spread = np.zeros((len(points), 3, 3))
    np.add.at(spread, ends[:, 0], away[:, :, None] * away[:, None])
    least, second, _ = np.linalg.eigvalsh(spread[count > FEWEST]).T
    return bool(len(least)) and bool(np.median(least.clip(0) / second.clip(1e-18)) < THINNEST**2)


def turns(points: Float64[Array, "N 3"], triples: Int64[Array, "S 3"]) -> Float64[Array, " S"]:
    """By how much each row turns at rest, 2 tan(θ/2)."""
    before = points[triples[:, 1]] - points[triples[:, 0]]
    after = points[triples[:, 2]] - points[triples[:, 1]]
    across = np.linalg.norm(np.cross(before, after), axis=1)
    along = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1) + (before * after).sum(1)
    turned: Float64[Array, " S"] = 2.0 * across / along
    return turned


def spans(points: Float64[Array, "N 3"], triples: Int64[Array, "S 3"]) -> Float64[Array, " S"]:
    """Length of each row's two pieces together at rest [m]."""
    before = np.linalg.norm(points[triples[:, 1]] - points[triples[:, 0]], axis=1)
    after = np.linalg.norm(points[triples[:, 2]] - points[triples[:, 1]], axis=1)
    length: Float64[Array, " S"] = before + after
    return length


def cells(points: Float64[Array, "N 3"], spacing: float) -> tuple[Int64[Array, "S 4"], Float64[Array, " S"]]:
    """Tetrahedra between neighbouring points, and their volumes [m³]; none in what is flat or thin.

    Args:
        points: At rest [m].
        spacing: Usual distance of neighbours [m].
    """
    nothing = np.zeros((0, 4), np.int64), np.zeros(0)
    if len(points) < 5:
        return nothing
    try:
        corners = Delaunay(points).simplices.astype(np.int64)
    except QhullError:  # all in one plane
        return nothing
    sides = points[corners[:, 1:]] - points[corners[:, :1]]
    volume = np.einsum("si,si->s", sides[:, 0], np.cross(sides[:, 1], sides[:, 2])) / 6.0
    corners[volume < 0] = corners[volume < 0][:, [0, 2, 1, 3]]
    apart = np.linalg.norm(points[corners][:, :, None] - points[corners][:, None], axis=-1)
    kept = (apart.max((1, 2)) <= LONGEST * spacing) & (np.abs(volume) >= FLATTEST * spacing**3)
    order = np.lexsort(corners[kept].T)
    return corners[kept][order], np.abs(volume)[kept][order]
