"""A solid: points on its surface and inside."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import ConvexHull, cKDTree

from model.gap.bodies.neighbours import farthest_points, usual_distance
from model.types import Array

SOLID_POINTS = 110
"""Inside a solid, about."""
SIGHT = np.cos(np.deg2rad(40.0))
"""A direction meets a surface that is within 40° of it."""
SURROUNDED = 0.62
"""Share of directions in which a point inside meets the surface: one side may be hidden from a camera."""


def lattice(places: Float64[Array, "N 3"], scale: float) -> tuple[Float64[Array, "P 3"], float]:
    """Points, and their spacing [m].

    Args:
        places: Seen points of the surface [m].
        scale: Of the spacing.
    """
    hull = ConvexHull(places)
    spacing = scale * max(usual_distance(places), float(hull.volume / SOLID_POINTS) ** (1 / 3))
    surface = places[farthest_points(places, 0.75 * spacing)]
    # along the solid's own axes, so that it has the same inside however it lies
    axes, middle = np.linalg.eigh(np.cov(places.T))[1], places.mean(0)
    own = (places - middle) @ axes
    grid = _grid(own, spacing)
    there = grid @ axes.T + middle
    grid = grid[(there @ hull.equations[:, :3].T + hull.equations[:, 3] < -0.2 * spacing).all(1)]
    if len(grid):
        grid = grid[cKDTree(own).query(grid)[0] > 0.6 * spacing]
    if len(grid):
        grid = grid[_surrounded(grid, own)]
    return np.concatenate([surface, grid @ axes.T + middle]), spacing


def _grid(places: Float64[Array, "N 3"], spacing: float) -> Float64[Array, "G 3"]:
    """Points between the least and the largest coordinates, as far from one as from the other."""
    low, high = places.min(0), places.max(0)
    lines = []
    for middle, size in zip((low + high) / 2, high - low, strict=True):
        count = max(1, int(size / spacing))
        lines.append(middle + spacing * (np.arange(count) - (count - 1) / 2))
    grid: Float64[Array, "G 3"] = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    return grid


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
