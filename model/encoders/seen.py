"""Differences between seen and simulated points, as a view measures them, and three looks at them."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy.spatial import cKDTree

from model.types import Array, Camera

NEIGHBOURS = 14
"""Points against whose mean the place of a point is its shape."""
LAG = 2
"""Frames over which a change counts as speed."""
Look: TypeAlias = Callable[[Float64[Array, "*v T N 3"]], Float64[Array, "*v U N 3"]]
"""Linear in the differences, so that it may be applied to measurements and to their derivatives alike."""


def across(
    differences: Float[Array, "*v T N 3"], points: Float[Array, "T N 3"], camera: Camera | None
) -> Float64[Array, "*v T N 3"]:
    """Differences [m] without their share along the line of sight to `points` [m]; whole without camera."""
    values: Float64[Array, "*v T N 3"] = np.asarray(differences, np.float64)
    if camera is None:
        return values
    sight = points.astype(np.float64) - camera.position
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    return np.asarray(values - (values * sight).sum(axis=-1, keepdims=True) * sight, np.float64)


def looks(rest: Float[Array, "N 3"], known: Bool[Array, "T N"]) -> dict[str, tuple[Look, Bool[Array, "U N"]]]:
    """Three looks at differences that are 0 where a point is not known, and where each look says something.

    `place` is the difference itself, `speed` its change over `LAG` frames (what swings fast), `shape` what it
    differs from that of the points around it (what bends and stretches here, whatever carries it).

    Args:
        rest: The points in frame 0 [m].
        known: Which differences are.
    """
    both = known[LAG:] & known[:-LAG]
    around = surroundings(rest)
    seen = known @ around.T
    close = known & (seen > 0.5 * around.sum(axis=1))
    scale = np.where(close, 1.0 / np.maximum(seen, 1e-9), 0.0)[..., None]

    def place(values: Float64[Array, "*v T N 3"]) -> Float64[Array, "*v T N 3"]:
        return values

    def speed(values: Float64[Array, "*v T N 3"]) -> Float64[Array, "*v U N 3"]:
        change = values[..., LAG:, :, :] - values[..., :-LAG, :, :]
        return np.asarray(np.where(both[..., None], change, 0.0), np.float64)

    def shape(values: Float64[Array, "*v T N 3"]) -> Float64[Array, "*v T N 3"]:
        return np.asarray(np.where(close[..., None], values - (around @ values) * scale, 0.0), np.float64)

    return {"place": (place, known), "speed": (speed, both), "shape": (shape, close)}


def surroundings(rest: Float[Array, "N 3"]) -> Float64[Array, "N N"]:
    """1 for each of the `NEIGHBOURS` points nearest to a point at rest, not for itself."""
    count = min(NEIGHBOURS + 1, len(rest))
    index = cKDTree(rest).query(rest, count)[1].reshape(len(rest), count)
    around = np.zeros((len(rest), len(rest)))
    np.put_along_axis(around, index, 1.0, axis=1)
    np.fill_diagonal(around, 0.0)
    return around
