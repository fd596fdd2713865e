"""Where matter is: bodies of simple pieces and sheets, and points drawn from them."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from model.types import Array

STEP = 1e-4
"""Of the differences that give a normal [m]."""
COARSE = 4
"""Places of a grid per side of the cells that are looked at first."""
SKIN = 0.05
"""How far below the surface its points lie, over the spacing: matter, not its skin, is what weighs."""


@dataclass(frozen=True)
class Capsule:
    """A tapered stick with round ends."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    start_radius: float
    end_radius: float

    def distance(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        """Signed distance [m] to the surface, about."""
        axis = np.subtract(self.end, self.start)
        offset = points - np.array(self.start)
        along = np.clip(offset @ axis / max(float(axis @ axis), 1e-18), 0.0, 1.0)
        radius = self.start_radius + along * (self.end_radius - self.start_radius)
        away: Float64[Array, " P"] = np.linalg.norm(offset - along[:, None] * axis, axis=1) - radius
        return away

    def box(self) -> Float64[Array, "2 3"]:
        """Corners of a box around it [m]."""
        ends = np.array([self.start, self.end])
        radii = np.array([[self.start_radius], [self.end_radius]])
        return np.stack([(ends - radii).min(axis=0), (ends + radii).max(axis=0)])


@dataclass(frozen=True)
class Block:
    """A box with round edges; as round as half its smallest side, it is a pill or a ball."""

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    """[m]."""
    rounding: float
    """Radius of its edges [m]."""

    def distance(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        """Signed distance [m] to the surface."""
        inner = np.array(self.half) - self.rounding
        beyond = np.abs(points - np.array(self.center)) - inner
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        away: Float64[Array, " P"] = outside + np.minimum(beyond.max(axis=1), 0.0) - self.rounding
        return away

    def box(self) -> Float64[Array, "2 3"]:
        """Corners of a box around it [m]."""
        return np.asarray(np.array(self.center) + np.array([[-1.0], [1.0]]) * np.array(self.half), np.float64)


class Body(ABC):
    """Matter at rest, each place of it in one part."""

    parts: int

    @abstractmethod
    def volume(self) -> float:
        """[m³]."""

    @abstractmethod
    def fill(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """About `count` points spread evenly through the body, the outer ones on its surface [m]."""

    @abstractmethod
    def samples(self, count: int) -> Float64[Array, "P 3"]:
        """About `count` points of a regular filling, each of which stands for as much volume [m]."""

    @abstractmethod
    def part(self, points: Float64[Array, "P 3"]) -> Int64[Array, " P"]:
        """The part that each point belongs to."""

    @abstractmethod
    def inside(self, points: Float64[Array, "P 3"], slack: float) -> Bool[Array, " P"]:
        """Which points lie in the body or within `slack` [m] of it."""

    @abstractmethod
    def surface(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """Points spread evenly over what can be seen and touched [m], at most `count`."""

    @abstractmethod
    def normals(self, points: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Unit vectors out of the body (of a sheet: up)."""


@dataclass(frozen=True)
class Cut:
    """The first piece of a solid, divided by planes across an axis."""

    axis: int
    borders: tuple[float, ...]
    """Rising [m]."""
    labels: tuple[int, ...]
    """The part of each slice, one more than there are borders."""


class Solid(Body):
    """The union of pieces.

    Args:
        pieces: What it is made of.
        labels: The part of each piece; a place in several pieces belongs to the one it is deepest in.
        cut: How the first piece is divided; None: it is one part.
    """

    def __init__(
        self, pieces: Sequence[Capsule | Block], labels: Sequence[int], cut: Cut | None = None
    ) -> None:
        """See the class."""
        self._pieces, self._labels, self._cut = tuple(pieces), np.array(labels), cut
        self.parts = max(int(self._labels.max()), *(cut.labels if cut else (0,))) + 1
        boxes = np.stack([piece.box() for piece in self._pieces])
        self._low, self._high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        coarse = float(np.cbrt(np.prod(self._high - self._low) / 20_000))
        around = len(self._regular(coarse)) * coarse**3
        spacing = float(np.cbrt(around / 20_000))
        self._volume = len(self._regular(spacing)) * spacing**3

    def volume(self) -> float:
        """[m³]."""
        return self._volume

    def fill(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """A jittered grid; what lies close to the surface is moved onto it."""
        spacing = float(np.cbrt(self._volume / count))
        for _ in range(2):  # points moved onto the surface make the body seem larger than it is
            points = self._grid(spacing, rng)
            spacing *= float(np.cbrt(len(points) / count))
        return self._grid(spacing, rng)

    def samples(self, count: int) -> Float64[Array, "P 3"]:
        """Jittered grid points inside."""
        return self._regular(float(np.cbrt(self._volume / count)))

    def part(self, points: Float64[Array, "P 3"]) -> Int64[Array, " P"]:
        """The part of the piece that each point is deepest in."""
        owner = self._each(points).argmin(axis=0)
        part = np.asarray(self._labels[owner], np.int64)
        if self._cut is not None:
            first, cut = owner == 0, self._cut
            part[first] = np.array(cut.labels)[np.searchsorted(cut.borders, points[first, cut.axis])]
        return part

    def inside(self, points: Float64[Array, "P 3"], slack: float) -> Bool[Array, " P"]:
        """Which points lie in the body or within `slack` [m] of it."""
        return np.asarray(self.distance(points) < slack)

    def surface(self, count: int, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """Grid points near the surface, moved onto it, thinned by distance."""
        spacing = float(np.cbrt(self._volume / (3 * count)))
        grid = self._cells(spacing, rng, 0.35)
        near = grid[np.abs(self.distance(grid)) < 0.75 * spacing]
        for _ in range(2):
            near = near - self.distance(near)[:, None] * self.normals(near)
        return np.asarray(near[spread(near, count, rng)], np.float64)

    def normals(self, points: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """By differences of the distance."""
        shifts = STEP * np.eye(3)
        slopes = [self.distance(points + shift) - self.distance(points - shift) for shift in shifts]
        vector = np.stack(slopes, axis=1)
        unit: Float64[Array, "P 3"] = vector / np.maximum(
            np.linalg.norm(vector, axis=1, keepdims=True), 1e-12
        )
        return unit

    def distance(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        """Signed distance [m] to the surface, about."""
        return np.asarray(self._each(points).min(axis=0), np.float64)

    def _each(self, points: Float64[Array, "P 3"]) -> Float64[Array, "M P"]:
        return np.stack([piece.distance(points) for piece in self._pieces])

    def _regular(self, spacing: float) -> Float64[Array, "P 3"]:
        """Jittered grid points inside, always the same ones."""
        grid = self._cells(spacing, np.random.default_rng(0), 0.5)
        return np.asarray(grid[self.distance(grid) < 0.0])

    def _cells(self, spacing: float, rng: np.random.Generator, jitter: float) -> Float64[Array, "P 3"]:
        """The places of a grid, begun at random, in and near the body, each moved at random.

        Large cells that are too far off for any of their places to be near are left out at once.
        """
        size, begin = COARSE * spacing, self._low - spacing * rng.uniform(0.5, 1.5, 3)
        axes = [np.arange(b, high + spacing, size) for b, high in zip(begin, self._high, strict=True)]
        corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        middle = (size - spacing) / 2.0
        corners = corners[self.distance(corners + middle) < np.sqrt(3.0) * middle + 1.2 * spacing]
        steps = np.stack(np.meshgrid(*[np.arange(COARSE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        grid = (corners[:, None] + spacing * steps).reshape(-1, 3)
        return np.asarray(grid + jitter * spacing * rng.uniform(-1.0, 1.0, grid.shape), np.float64)

    def _grid(self, spacing: float, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        points = self._cells(spacing, rng, 0.2)
        depth = -self.distance(points)
        # the cells that the surface runs through give it a layer of points, whatever side their middle is on
        points, depth = points[depth > -0.5 * spacing], depth[depth > -0.5 * spacing]
        outer = depth < 0.5 * spacing
        shell = points[outer]
        points[outer] = shell + (depth[outer] - SKIN * spacing)[:, None] * self.normals(shell)
        close = cKDTree(points).query_pairs(0.35 * spacing, output_type="ndarray")
        return np.delete(points, np.unique(close[:, 1]), axis=0)


def shares(body: Body, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
    """Volume that is nearest to each point [m³], of all the body's."""
    samples = body.samples(max(8000, 8 * len(points)))
    count = np.bincount(cKDTree(points).query(samples)[1], minlength=len(points))
    volume: Float64[Array, " P"] = body.volume() * np.maximum(count, 1) / np.maximum(count, 1).sum()
    return volume


def spread(points: Float64[Array, "P 3"], count: int, rng: np.random.Generator) -> Int64[Array, " n"]:
    """Indices of at most `count` points, each far from those before (farthest-point sampling).

    Reference:
        Gonzalez (1985), Clustering to minimize the maximum intercluster distance.
    """
    taken = [int(rng.integers(len(points)))]
    distance = ((points - points[taken[0]]) ** 2).sum(axis=1)
    while len(taken) < min(count, len(points)):
        taken.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[taken[-1]]) ** 2).sum(axis=1))
    return np.array(taken, np.int64)
