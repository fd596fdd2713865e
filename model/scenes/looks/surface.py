"""The surface of a body that is known by the Gaussians that fill it."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from scipy.spatial import cKDTree

from model.rotations import matrices
from model.types import Array, Gaussians

WIDTH = 0.6
"""Standard deviation of a Gaussian of the field, over the side of the cube that it stands for."""
LEVEL, WHOLE = 1.0, 0.6
"""Of the field on the surface; at most the second times what one in ten Gaussians is below, so that the
surface encloses them."""
SUNK = 0.5
"""How far the surface is moved inwards to known points of it, at most: in spacings, of round Gaussians."""
NEAR = 12
"""Gaussians that count at a place."""
OUT = 2.7
"""Outside every surface: this far from the centre of a Gaussian at it, in standard deviations."""
FLATTEST = 0.2
"""Least thickness of a Gaussian of the field over its width."""
BISECTIONS = 6
EVEN, SWEEPS = 1.2, 2
"""Within how many spacings the surface is evened out, and how often."""
CHUNK = 60_000


@dataclass(frozen=True)
class Surface:
    """Points spread over a surface."""

    points: Float64[Array, "P 3"]
    """[m]."""
    normals: Float64[Array, "P 3"]
    """Outward, unit."""
    owner: Int64[Array, " P"]
    """The nearest Gaussian."""
    spacing: float
    """Between points [m]."""


def surface_of(
    gaussians: Gaussians,
    spacing: float,
    rng: np.random.Generator,
    known: Float[Array, "N 3"] | None = None,
) -> Surface:
    r"""Points spread over a level of $\sum_g \exp(-\tfrac12 m_g^2)$, evened out.

    m is the Mahalanobis distance to a Gaussian, made larger where its volume asks for it.
    From every Gaussian, rays go out until they leave the body.

    Args:
        gaussians: What fills the body.
        spacing: About how far apart the points shall be [m].
        rng: For the directions of the rays.
        known: Points on the surface [m], if any: it is laid through them.

    Reference:
        Blinn (1982), A generalization of algebraic surface drawing.
    """
    field = _Field(gaussians)
    level = field.level()
    reach = field.reach
    rays = int(np.clip(8.0 * (field.spacing / spacing) ** 2, 24, 240))
    # Only Gaussians that see the outside send out rays.
    probe = _sphere(14)
    outside = [field.value(field.means + reach[:, None] * ray) < level for ray in probe]
    rim = np.flatnonzero(np.stack(outside).any(axis=0))
    turned = _sphere(rays) @ _turn(rng).T
    start = np.repeat(rim, rays)
    ray = np.tile(turned, (len(rim), 1))
    open_ = field.value(field.means[start] + reach[start, None] * ray) < level
    start, ray = start[open_], ray[open_]
    low, high = np.zeros(len(start)), reach[start]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        inside = field.value(field.means[start] + middle[:, None] * ray) >= level
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    points = field.means[start] + high[:, None] * ray
    points = _thinned(points, 0.7 * spacing)
    points, normals = _evened(points, field, EVEN * field.spacing)
    kept = _first_of_cells(points, 0.9 * spacing)
    points, normals = points[kept], normals[kept]
    if known is not None:
        points = points + _offset(known.astype(np.float64), points, normals, field) * normals
    return Surface(points, normals, field.nearest(points), spacing)


class _Field:
    """The sum of the Gaussians, each 1 at its centre."""

    def __init__(self, gaussians: Gaussians) -> None:
        self.means = gaussians.means.astype(np.float64)
        self.side = np.cbrt(gaussians.volumes.astype(np.float64))
        scales = gaussians.scales.astype(np.float64)
        small = WIDTH * self.side / np.cbrt(scales.prod(axis=1))
        scales = scales * np.maximum(small, 1.0)[:, None]
        # Flat ones stay flat, but no flatter than keeps the surface in one piece.
        scales = np.maximum(scales, FLATTEST * scales.max(axis=1, keepdims=True))
        self.reach = OUT * scales.max(axis=1)
        self.spacing = float(np.median(scales.max(axis=1))) / WIDTH
        self.thickness = float(np.median(scales.min(axis=1))) / WIDTH
        self.whitening = (
            matrices(torch.as_tensor(gaussians.quaternions)).double().numpy() / scales[:, None, :]
        )
        self.tree = cKDTree(self.means)

    def nearest(self, points: Float64[Array, "P 3"]) -> Int64[Array, " P"]:
        owner: Int64[Array, " P"] = self.tree.query(points)[1].astype(np.int64)
        return owner

    def level(self) -> float:
        return min(LEVEL, WHOLE * float(np.quantile(self.value(self.means), 0.1)))

    def value(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        return self.with_gradient(points)[0]

    def with_gradient(
        self, points: Float64[Array, "P 3"]
    ) -> tuple[Float64[Array, " P"], Float64[Array, "P 3"]]:
        value, gradient = np.empty(len(points)), np.empty((len(points), 3))
        near = min(NEAR, len(self.means))
        for begin in range(0, len(points), CHUNK):
            part = slice(begin, begin + CHUNK)
            index = self.tree.query(points[part], near)[1].reshape(-1, near)
            offset = points[part, None] - self.means[index]
            white = np.einsum("pki,pkij->pkj", offset, self.whitening[index])
            each = np.exp(-0.5 * (white**2).sum(axis=2))
            value[part] = each.sum(axis=1)
            gradient[part] = -np.einsum("pk,pkj,pkij->pi", each, white, self.whitening[index])
        return value, gradient


def _offset(
    known: Float64[Array, "N 3"], points: Float64[Array, "P 3"], normals: Float64[Array, "P 3"], field: _Field
) -> float:
    """How far outwards of the surface known points of it are [m]; thin sheets keep their thickness."""
    index = cKDTree(points).query(known)[1]
    height = float(np.median(((known - points[index]) * normals[index]).sum(axis=1)))
    return float(np.clip(height, -SUNK * field.thickness, SUNK * field.thickness))


def _evened(
    points: Float64[Array, "P 3"], field: _Field, radius: float
) -> tuple[Float64[Array, "P 3"], Float64[Array, "P 3"]]:
    """Move points along their normals to the middle of their neighbourhood; smooth the normals."""
    _, gradient = field.with_gradient(points)
    normals = -gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)
    for _ in range(SWEEPS):
        distance, index = cKDTree(points).query(points, min(24, len(points)))
        facing = np.einsum("pi,pki->pk", normals, normals[index])
        # The other side of a thin sheet is near, and looks the other way.
        weight = np.exp(-((distance / radius) ** 2)) * np.clip(facing, 0, 1)
        weight /= weight.sum(axis=1, keepdims=True)
        lift = np.einsum("pk,pki,pi->p", weight, points[index] - points[:, None], normals)
        points = points + lift[:, None] * normals
        normals = np.einsum("pk,pki->pi", weight, normals[index])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return points, normals


def _thinned(points: Float64[Array, "P 3"], cell: float) -> Float64[Array, "Q 3"]:
    thinned: Float64[Array, "Q 3"] = points[_first_of_cells(points, cell)]
    return thinned


def _first_of_cells(points: Float64[Array, "P 3"], cell: float) -> Int64[Array, " Q"]:
    _, first = np.unique(np.floor(points / cell), axis=0, return_index=True)
    return np.sort(first)


def _sphere(count: int) -> Float64[Array, "n 3"]:
    """Directions spread evenly (a Fibonacci spiral)."""
    place = np.arange(count) + 0.5
    height = 1 - 2 * place / count
    around = np.pi * (1 + np.sqrt(5)) * place
    level = np.sqrt(1 - height**2)
    return np.stack([level * np.cos(around), level * np.sin(around), height], axis=1)


def _turn(rng: np.random.Generator) -> Float64[Array, "3 3"]:
    return matrices(torch.as_tensor(rng.normal(size=4))).numpy()
