"""A solid: points on its surface and inside."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, cKDTree

from model.errors import InputError
from model.gap.bodies.inside import Inside
from model.gap.bodies.neighbours import farthest_points, usual_distance
from model.types import Array

SOLID_POINTS = 110
"""Inside a solid, about."""
WITHIN = 0.45
"""`Inside` of what is filled."""
CELLS = 600
"""Of the convex hull, about, in which it is looked how much of it is filled."""
FLAT = 1e-4
"""Of their size: points that are no farther from a plane have no volume between them. Where rounding alone
parts them, cells as large as they are thick would be too many for any memory."""


def spans_volume(places: Float64[Array, "N 3"]) -> bool:
    """Whether these points are not all in one plane, as three always are."""
    size = np.linalg.svd(places - places.mean(0), compute_uv=False)
    return len(size) == 3 and bool(size[2] > FLAT * size[0])


def lattice(places: Float64[Array, "N 3"], scale: float) -> tuple[Float64[Array, "P 3"], float]:
    """Points, and their spacing [m].

    Args:
        places: Seen points of the surface [m].
        scale: Of the spacing.

    Raises:
        InputError: they are all in one plane.
    """
    if not spans_volume(places):
        raise InputError("points: all that are seen of a solid are in one plane: nothing to fill it between")
    # along the solid's own axes, so that it has the same inside however it lies
    axes, middle = np.linalg.eigh(np.cov(places.T))[1], places.mean(0)
    own = (places - middle) @ axes
    hull, inside = ConvexHull(own), Inside.of(own)
    cells = _deep(_grid(own, float(hull.volume / CELLS) ** (1 / 3)), hull, 0.0)
    filled = float((inside(cells) > WITHIN).mean()) if len(cells) else 1.0
    volume = float(hull.volume) * max(filled, 1.0 / CELLS)
    spacing = scale * max(usual_distance(places), (volume / SOLID_POINTS) ** (1 / 3))
    surface = places[farthest_points(places, 0.75 * spacing)]
    grid = _deep(_grid(own, spacing), hull, 0.2 * spacing)
    if len(grid):
        grid = grid[cKDTree(own).query(grid)[0] > 0.6 * spacing]
    if len(grid):
        grid = grid[inside(grid) > WITHIN]
    return np.concatenate([surface, grid @ axes.T + middle]), spacing


def _deep(points: Float64[Array, "G 3"], hull: ConvexHull, depth: float) -> Float64[Array, "H 3"]:
    """Those that lie more than `depth` [m] below the surface of a hull."""
    apart = points @ hull.equations[:, :3].T + hull.equations[:, 3]
    deep: Float64[Array, "H 3"] = points[(apart < -depth).all(1)]
    return deep


def _grid(places: Float64[Array, "N 3"], spacing: float) -> Float64[Array, "G 3"]:
    """Points between the least and the largest coordinates, as far from one as from the other."""
    low, high = places.min(0), places.max(0)
    lines = []
    for middle, size in zip((low + high) / 2, high - low, strict=True):
        count = max(1, int(size / spacing))
        lines.append(middle + spacing * (np.arange(count) - (count - 1) / 2))
    grid: Float64[Array, "G 3"] = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    return grid
