"""A solid: points on its surface and inside, joined to all their neighbours."""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import ConvexHull, cKDTree

from model.gap.bodies.neighbours import farthest_points, pairs_within, usual_distance
from model.types import Array

SOLID_POINTS = 110
"""Inside a solid, about."""
SIGHT = np.cos(np.deg2rad(40.0))
"""A direction meets a surface that is within 40° of it."""
SURROUNDED = 0.62
"""Share of directions in which a point inside meets the surface: one side may be hidden from a camera."""


def lattice(
    places: Float64[Array, "N 3"], scale: float
) -> tuple[Float64[Array, "P 3"], Int64[Array, "E 2"], float]:
    """Points, springs, and the spacing [m].

    Args:
        places: Seen points of the surface [m].
        scale: Of the spacing.
    """
    hull = ConvexHull(places)
    spacing = scale * max(usual_distance(places), float(hull.volume / SOLID_POINTS) ** (1 / 3))
    surface = places[farthest_points(places, 0.75 * spacing)]
    axes = [
        np.arange(low + 0.5 * spacing, high, spacing)
        for low, high in zip(places.min(0), places.max(0), strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    grid = grid[(grid @ hull.equations[:, :3].T + hull.equations[:, 3] < -0.2 * spacing).all(1)]
    if len(grid):
        grid = grid[cKDTree(places).query(grid)[0] > 0.6 * spacing]
    if len(grid):
        grid = grid[_surrounded(grid, places)]
    points = np.concatenate([surface, grid])
    return points, pairs_within(points, 1.8 * spacing, least=6), spacing


def _surrounded(grid: Float64[Array, "G 3"], places: Float64[Array, "N 3"]) -> Bool[Array, " G"]:
    """Which points have the surface around them, asked in 26 directions."""
    steps = np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]], indexing="ij"), -1).reshape(-1, 3)
    steps = steps[np.abs(steps).sum(1) > 0]
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    way = places[None] - grid[:, None]
    way /= np.linalg.norm(way, axis=-1, keepdims=True).clip(1e-12)
    met = (way @ steps.T > SIGHT).any(1)
    inside: Bool[Array, " G"] = met.mean(1) >= SURROUNDED
    return inside
