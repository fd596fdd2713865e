"""Cloths: bodies that are an outline in the plane, a thickness and gentle waves."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from model.scenes.world.body import SKIN, STEP, Body, spread
from model.types import Array


class Sheet(Body):
    """A cloth: an outline in the plane, a thickness, and gentle waves.

    Args:
        half: Half its sides [m].
        corner: How round its corners are, over the shorter half side: 0 a rectangle, 1 an ellipse's ends.
        thickness: [m].
        waves: Rows (height [m], wave numbers x, y [1/m], phase) of its undulation.
        borders: Where along the first side one part ends and the next begins [m], rising.
    """

    def __init__(
        self,
        half: tuple[float, float],
        corner: float,
        thickness: float,
        waves: Float64[Array, "W 4"],
        borders: Sequence[float],
    ) -> None:
        """See the class."""
        self._half, self._corner = np.array(half), corner * min(half)
        self._thickness, self._waves, self._borders = thickness, waves, np.array(borders, np.float64)
        self.parts = len(borders) + 1
        self._area = float(4.0 * np.prod(self._half) - (4.0 - np.pi) * self._corner**2)

    def volume(self) -> float:
        """[m³]."""
        return self._area * self._thickness

    def fill(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """A jittered grid in the plane; what lies close to the outline is moved onto it."""
        spacing = float(np.sqrt(self._area / count))
        plane = self._plane(spacing, rng, 0.2)
        away = self._away(plane)
        plane, away = plane[away < 0.5 * spacing], away[away < 0.5 * spacing]
        outer = away > -0.5 * spacing
        shifts = STEP * np.eye(2)
        slope = np.stack(
            [self._away(plane[outer] + s) - self._away(plane[outer] - s) for s in shifts], axis=1
        )
        slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
        plane[outer] -= (away[outer] + SKIN * spacing)[:, None] * slope
        close = cKDTree(plane).query_pairs(0.35 * spacing, output_type="ndarray")
        return self._raised(np.delete(plane, np.unique(close[:, 1]), axis=0))

    def samples(self, count: int) -> Float64[Array, "P 3"]:
        """Jittered grid points within the outline."""
        spacing = float(np.sqrt(self._area / count))
        plane = self._plane(spacing, np.random.default_rng(0), 0.5)
        return self._raised(plane[self._away(plane) < 0.0])

    def part(self, points: Float64[Array, "P 3"]) -> Int64[Array, " P"]:
        """By where along the first side each point is."""
        return np.asarray(np.searchsorted(self._borders, points[:, 0]), np.int64)

    def inside(self, points: Float64[Array, "P 3"], slack: float) -> Bool[Array, " P"]:
        """Which points lie over the outline, or within `slack` [m] of it."""
        return np.asarray(self._away(points[:, :2]) < slack)

    def surface(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """As the points that fill it, thinned by distance."""
        points = self.fill(3 * count, rng)
        return np.asarray(points[spread(points, count, rng)], np.float64)

    def normals(self, points: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Up, tilted by the waves."""
        shifts = np.array([[STEP, 0.0], [0.0, STEP]])
        slopes = [
            (self._height(points[:, :2] + s) - self._height(points[:, :2] - s)) / (2.0 * STEP) for s in shifts
        ]
        normal = np.stack([-slopes[0], -slopes[1], np.ones(len(points))], axis=1)
        unit: Float64[Array, "P 3"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        return unit

    def _away(self, plane: Float64[Array, "P 2"]) -> Float64[Array, " P"]:
        """Signed distance [m] to the outline."""
        beyond = np.abs(plane) - (self._half - self._corner)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        away: Float64[Array, " P"] = outside + np.minimum(beyond.max(axis=1), 0.0) - self._corner
        return away

    def _height(self, plane: Float64[Array, "P 2"]) -> Float64[Array, " P"]:
        if not len(self._waves):
            return np.full(len(plane), self._thickness / 2.0)
        size, first, second, phase = self._waves.T
        angle = plane[:, :1] * first + plane[:, 1:] * second + phase
        height: Float64[Array, " P"] = self._thickness / 2.0 + (size * (1.0 + np.sin(angle))).sum(axis=1)
        return height

    def _plane(self, spacing: float, rng: np.random.Generator, jitter: float) -> Float64[Array, "P 2"]:
        """A grid around the outline, begun at a random place, each of its points moved at random."""
        begin = -self._half - spacing * rng.uniform(0.5, 1.5, 2)
        axes = [np.arange(b, half + spacing, spacing) for b, half in zip(begin, self._half, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.asarray(grid + jitter * spacing * rng.uniform(-1.0, 1.0, grid.shape), np.float64)

    def _raised(self, plane: Float64[Array, "P 2"]) -> Float64[Array, "P 3"]:
        return np.column_stack([plane, self._height(plane)])
