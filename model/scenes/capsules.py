"""Bodies made of tapered capsules that melt into each other: distance, normals, samples."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from model.types import Array

MELT = 0.003
"""How far around a joint two capsules blend [m]."""
CHUNK = 8192
"""Points looked at together."""


@dataclass(frozen=True)
class Capsules:
    """A union of capsules, each thick at its ends as given and linear in between."""

    starts: Float64[Array, "M 3"]
    """[m]."""
    ends: Float64[Array, "M 3"]
    """[m]."""
    start_radii: Float64[Array, " M"]
    """[m]."""
    end_radii: Float64[Array, " M"]
    """[m]."""

    def distances(
        self, points: Float64[Array, "P 3"]
    ) -> tuple[Float64[Array, "P M"], Float64[Array, "P M"], Float64[Array, "P M 3"]]:
        """Per capsule: signed distance [m] to its surface, how far along it (0..1), away from its axis."""
        axis = self.ends - self.starts
        length = np.maximum((axis**2).sum(axis=1), 1e-18)
        offset = points[:, None] - self.starts
        along = np.clip((offset * axis).sum(axis=2) / length, 0, 1)
        away = offset - along[..., None] * axis
        reach = np.sqrt((away**2).sum(axis=2))
        radius = self.start_radii + along * (self.end_radii - self.start_radii)
        return reach - radius, along, away / np.maximum(reach, 1e-12)[..., None]

    def field(self, points: Float64[Array, "P 3"]) -> tuple[Float64[Array, " P"], Float64[Array, "P 3"]]:
        """Signed distance [m] to the union, smooth where capsules meet, and the outward unit normal."""
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        for begin in range(0, len(points), CHUNK):
            part = slice(begin, begin + CHUNK)
            each, _, away = self.distances(points[part])
            nearest = each.min(axis=1, keepdims=True)
            share = np.exp((nearest - each) / MELT)
            distance[part] = nearest[:, 0] - MELT * np.log(share.sum(axis=1))
            normal[part] = np.einsum("pm,pmi->pi", share, away)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return distance, normal

    def distance(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        """Signed distance [m] to the union."""
        return self.field(points)[0]

    def owners(self, points: Float64[Array, "P 3"]) -> tuple[Int64[Array, " P"], Float64[Array, " P"]]:
        """The nearest capsule of each point, and how far along it (0..1) the point is."""
        each, along, _ = self.distances(points)
        owner = each.argmin(axis=1)
        return owner, np.take_along_axis(along, owner[:, None], axis=1)[:, 0]

    def fill(self, spacing: float, depth: float, rng: np.random.Generator) -> Float64[Array, "P 3"]:
        """Jittered grid points at least `depth` [m] below the surface."""
        grid = self._cells(spacing, -np.inf, -depth)
        grid = grid + rng.uniform(-0.25, 0.25, grid.shape) * spacing
        inside: Float64[Array, "P 3"] = grid[self.distance(grid) < -depth]
        return inside

    def surface(self, spacing: float) -> Float64[Array, "P 3"]:
        """Points on the surface, about `spacing` [m] apart."""
        candidates = self._cells(0.7 * spacing, -0.1 * spacing, 0.1 * spacing)
        for _ in range(2):
            distance, normals = self.field(candidates)
            candidates = candidates - distance[:, None] * normals
        _, first = np.unique(np.floor(candidates / (0.9 * spacing)), axis=0, return_index=True)
        thinned: Float64[Array, "P 3"] = candidates[np.sort(first)]
        return thinned

    def _cells(self, spacing: float, low: float, high: float) -> Float64[Array, "P 3"]:
        """Centres of the cells of a regular grid that may hold distances between `low` and `high` [m].

        Large cells are split again and again, and left out as soon as all of them is too far off.
        """
        levels = max(0, int(np.ceil(np.log2(0.05 / spacing))))
        size = spacing * 2**levels
        thickest = np.maximum(self.start_radii, self.end_radii)[:, None]
        corner = np.floor((np.minimum(self.starts, self.ends) - thickest).min(axis=0) / size) - 1
        last = np.ceil((np.maximum(self.starts, self.ends) + thickest).max(axis=0) / size) + 1
        axes = [np.arange(a, b) for a, b in zip(corner, last, strict=True)]
        centers: Array = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * size
        corners = np.stack(np.meshgrid(*[(-0.25, 0.25)] * 3, indexing="ij"), axis=-1).reshape(8, 3)
        while True:
            distance, slack = self.distance(centers), size * np.sqrt(3) / 2
            centers = centers[(distance > low - slack) & (distance < high + slack)]
            if levels == 0:
                return centers
            centers = (centers[:, None] + corners * size).reshape(-1, 3)
            size, levels = size / 2, levels - 1


def chain(*nodes: tuple[float, float, float, float]) -> Capsules:
    """Capsules one after another through nodes (x, y, z, radius) [m]; a single node is a ball."""
    table = np.array(nodes if len(nodes) > 1 else nodes * 2, np.float64)
    return Capsules(table[:-1, :3], table[1:, :3], table[:-1, 3], table[1:, 3])


def union(*bodies: Capsules) -> Capsules:
    """All of them as one body, in this order."""
    return Capsules(
        np.concatenate([body.starts for body in bodies]),
        np.concatenate([body.ends for body in bodies]),
        np.concatenate([body.start_radii for body in bodies]),
        np.concatenate([body.end_radii for body in bodies]),
    )
