"""Patterns that fill space, so that any body can be cut out of them: smooth noise, cells, stripes."""

import numpy as np
from jaxtyping import Float64, Int64

from model.types import Array

_PRIMES = np.array([73856093, 19349663, 83492791], np.int64)


def noise(place: Float64[Array, "P 3"], scale: float, seed: int) -> Float64[Array, " P"]:
    """Smooth noise with features of about `scale` [m], within -1 … 1.

    Reference:
        Perlin (2002), Improving noise (the quintic fade; values at the lattice here, not gradients).
    """
    corner = np.floor(place / scale)
    share = place / scale - corner
    fade = share**3 * (share * (6 * share - 15) + 10)
    total = np.zeros(len(place))
    for bits in range(8):
        step = np.array([bits & 1, bits >> 1 & 1, bits >> 2 & 1])
        weight = np.where(step, fade, 1 - fade).prod(axis=1)
        total += weight * _values((corner + step).astype(np.int64), seed)
    return 2 * total - 1


def cells(
    place: Float64[Array, "P 3"], scale: float, seed: int
) -> tuple[Float64[Array, " P"], Int64[Array, "P 3"]]:
    """How far from the border of its cell a point is (0: on it), over `scale`, and which cell it is in.

    Reference:
        Worley (1996), A cellular texture basis function: second nearest less nearest centre.
    """
    home = np.floor(place / scale).astype(np.int64)
    nearest, second = np.full(len(place), np.inf), np.full(len(place), np.inf)
    owner = home.copy()
    for step in np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3):
        cell = home + step
        centre = cell + np.stack([_values(cell, seed + axis) for axis in range(3)], axis=1)
        distance = np.linalg.norm(place / scale - centre, axis=1)
        closer = distance < nearest
        second = np.where(closer, nearest, np.minimum(second, distance))
        owner[closer] = cell[closer]
        nearest = np.where(closer, distance, nearest)
    return second - nearest, owner


def directions(cell: Int64[Array, "P 3"], seed: int) -> Float64[Array, "P 3"]:
    """One direction per cell, each coordinate within -1 … 1."""
    return 2 * np.stack([_values(cell, seed + 10 + axis) for axis in range(3)], axis=1) - 1


def stripes(along: Float64[Array, " P"], period: float, width: float = 0.5) -> Float64[Array, " P"]:
    """1 on stripes that cover the share `width`, 0 between them, soft at their edges."""
    wave = np.cos(2 * np.pi * along / period) - np.cos(np.pi * width)
    share: Float64[Array, " P"] = np.clip(0.5 + 2.0 * wave, 0, 1)
    return share


def blend(
    under: Float64[Array, "*under 3"], over: Float64[Array, "*over 3"], share: Float64[Array, " P"]
) -> Float64[Array, "P 3"]:
    """`over` where the share is 1, `under` where it is 0."""
    blended: Float64[Array, "P 3"] = under + share[:, None] * (over - under)
    return blended


def _values(corner: Int64[Array, "P 3"], seed: int) -> Float64[Array, " P"]:
    """A number within 0 … 1 for each lattice point, the same each time."""
    mixed = (corner * _PRIMES).sum(axis=1) + np.int64(seed) * np.int64(2654435761)
    bits = mixed.astype(np.uint64)
    for shift, factor in ((33, 0xFF51AFD7ED558CCD), (33, 0xC4CEB9FE1A85EC53)):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    values: Float64[Array, " P"] = (bits >> np.uint64(40)).astype(np.float64) / float(1 << 24)
    return values
