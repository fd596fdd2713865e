"""A sheet: mass points in rows of triangles on it."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import Delaunay, cKDTree

from model.gap.bodies.neighbours import covering_points, farthest_points, usual_distance
from model.gap.bodies.unrolled import unrolled
from model.types import Array

SHEET_POINTS = 120
"""On a sheet, about."""
MORE_POINTS = 240
"""At most about, where they are some of those that are seen."""
FEW = 40
"""Markers that are fewer stay mass points themselves: between them nothing is known."""
NARROW = 0.02
"""Of its length: what is narrower has no room for rows."""
ENOUGH = 300
"""Of seen points: nearer to each other their noise would hide how the sheet lies."""
BEYOND = 0.6
"""Spacings: a net reaches at most so far beyond what is seen."""
GAP = 3.0
"""Spacings of what is seen: what is wider and has nothing in it is a hole."""
AROUND, PER_POINT = 10, 3
"""Seen points that tell how high a point of the net is; so many times as many as there are for each of them
where that is more."""


def net(places: Float64[Array, "N 3"], scale: float) -> tuple[Float64[Array, "P 3"], float]:
    """Points, and their spacing [m].

    Three points that are bent in a row are a hinge; of points that lie anywhere three that meet are none, for
    they turn about their long side and stay as they are. So points are put in rows of triangles, which go on
    in three directions, in the sheet laid out flat, each as high as what is seen around it. Where a sheet
    cannot be laid out, or has few markers, its points are some of those that are seen.

    Args:
        places: Seen points [m].
        scale: Of the spacing.
    """
    places = places[covering_points(places, ENOUGH)]
    if len(places) < FEW:
        return _among(places, scale)
    flat = unrolled(places)
    if flat is None or np.ptp(flat, axis=0).min() < NARROW * np.ptp(flat, axis=0).max():
        return _among(places, scale)
    spacing = scale * _spacing(flat)
    at = _triangles(flat, spacing)
    return _lifted(at, flat, places), spacing


def _among(places: Float64[Array, "N 3"], scale: float) -> tuple[Float64[Array, "P 3"], float]:
    """Some of the seen points, evenly."""
    size = np.sqrt(np.linalg.eigvalsh(np.cov(places.T)).clip(0) * 12.0)
    spacing = scale * max(usual_distance(places), float(np.sqrt(size[2] * size[1] / MORE_POINTS)))
    points: Float64[Array, "P 3"] = places[farthest_points(places, 0.8 * spacing)]
    return points, max(spacing, usual_distance(points))


def _spacing(flat: Float64[Array, "N 2"]) -> float:
    """With which there are about `SHEET_POINTS`, whatever the outline [m]."""
    fine, coarse = (np.sqrt(np.prod(np.ptp(flat, axis=0)) / (by * SHEET_POINTS)) for by in (8.0, 0.5))
    for _ in range(12):
        middle = float(np.sqrt(fine * coarse))
        if len(_triangles(flat, middle)) > SHEET_POINTS:
            fine = middle
        else:
            coarse = middle
    return float(coarse)


def _triangles(flat: Float64[Array, "N 2"], spacing: float) -> Float64[Array, "P 2"]:
    """Corners of triangles with equal sides that cover what is seen, rows along the first axis.

    One is in the middle: turned by half a turn, or seen from behind, they are the same.
    """
    size = np.abs(flat).max(0) + spacing
    high = spacing * np.sqrt(0.75)
    rows, columns = (
        int(np.ceil(reach / step)) for reach, step in zip(size[::-1], (high, spacing), strict=True)
    )
    j, i = np.meshgrid(np.arange(-rows, rows + 1), np.arange(-columns, columns + 1), indexing="ij")
    at = np.stack([spacing * (i + 0.5 * (j % 2)), high * j], -1).reshape(-1, 2)
    kept: Float64[Array, "P 2"] = at[_covered(at, flat, spacing)]
    return kept


def _covered(at: Float64[Array, "n 2"], flat: Float64[Array, "N 2"], spacing: float) -> Bool[Array, " n"]:
    """Which places are on the sheet, or hardly beside it."""
    near = cKDTree(flat).query(at)[0] < BEYOND * spacing
    between = Delaunay(flat)
    corners = flat[between.simplices]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(1)
    filled = longest < GAP * max(spacing, float(np.median(longest)))
    inside = between.find_simplex(at)
    on: Bool[Array, " n"] = near | ((inside >= 0) & filled[inside])
    return on


def _lifted(
    at: Float64[Array, "P 2"], flat: Float64[Array, "N 2"], places: Float64[Array, "N 3"]
) -> Float64[Array, "P 3"]:
    """Where they are in space [m]: on planes of the seen points around them, the nearest counting most."""
    count = min(max(AROUND, PER_POINT * len(flat) // len(at)), len(flat))
    distance, near = cKDTree(flat).query(at, k=count)
    closeness = np.exp(-2.0 * (distance / distance[:, -1:]) ** 2)[..., None]
    way = (flat[near] - at[:, None]) / distance[:, -1:, None]
    rows = np.concatenate([np.ones((*near.shape, 1)), way], -1)
    weighted = (rows * closeness).swapaxes(1, 2)
    middle = places.mean(0)
    planes = np.linalg.solve(weighted @ rows + 1e-9 * np.eye(3), weighted @ (places[near] - middle))
    lifted: Float64[Array, "P 3"] = middle + planes[:, 0]
    return lifted
