"""Places in a body where an effect may act, as fields over its mass points."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from model.types import Array

EDGE = 0.05
"""Width of the edge between two halves, in lengths of the body."""
THIN = 0.2
"""An axis along which a body is shorter than this share of its length is not cut."""
CUT, OTHER_CUTS = 0.5, (0.35, 0.65)
"""Where a body is cut in two, in shares of its points."""
PATCHES = 6
RADIUS, OTHER_RADII = 0.2, (0.12, 0.3)
"""Of a patch, in lengths of the body."""


@dataclass(frozen=True)
class Place:
    """Where an effect may act."""

    kind: Literal["everywhere", "side", "patch"]
    field: Float64[Array, " P"]
    """0..1."""
    anchor: Float64[Array, "3"]
    """Of a side: the direction in which it lies. Of a patch: its centre [m]."""


def everywhere(points: Float64[Array, "P 3"]) -> Place:
    """All of a body."""
    return Place("everywhere", np.ones(len(points)), np.zeros(3))


def first_places_of(points: Float64[Array, "P 3"]) -> list[Place]:
    """Both sides of a cut across each axis of the body, and patches that cover it.

    Args:
        points: At rest [m].
    """
    return [*halves_of(points), *(_patch(points, points[i], RADIUS) for i in centres(points, PATCHES))]


def halves_of(points: Float64[Array, "P 3"]) -> list[Place]:
    """Both sides of a cut across each axis of the body.

    Args:
        points: At rest [m].
    """
    centred = points - points.mean(0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    lengths = np.ptp(centred @ axes.T, axis=0)
    directions = [sign * axis for axis in axes[lengths > THIN * lengths.max()] for sign in (1.0, -1.0)]
    return [_side(points, direction, CUT) for direction in directions]


def near_places_of(points: Float64[Array, "P 3"], place: Place) -> list[Place]:
    """The same side of other cuts, or the same patch larger and smaller."""
    if place.kind == "side":
        return [_side(points, place.anchor, cut) for cut in OTHER_CUTS]
    if place.kind == "patch":
        return [_patch(points, place.anchor, radius) for radius in OTHER_RADII]
    return []


def centres(points: Float64[Array, "P 3"], count: int) -> Int64[Array, " k"]:
    """Indices of points that cover the body: each the farthest from those before it."""
    apart = np.linalg.norm(points - points.mean(0), axis=1)
    chosen = [int(apart.argmax())]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, np.int64)


def rescaled(field: Float64[Array, " P"]) -> Float64[Array, " P"]:
    """With 1 as its largest value; 1 everywhere where nothing is above zero."""
    top = float(field.max(initial=0.0))
    return np.clip(field / top, 0.0, 1.0) if top > 0 else np.ones(len(field))


def tensor(field: Float64[Array, " P"]) -> Tensor:
    """For `Effect.apply`."""
    return torch.from_numpy(np.ascontiguousarray(field, np.float64))


def _length(points: Float64[Array, "P 3"]) -> float:
    return max(float(2.0 * np.linalg.norm(points - points.mean(0), axis=1).max()), 1e-9)


def _side(points: Float64[Array, "P 3"], direction: Float64[Array, "3"], cut: float) -> Place:
    along = points @ direction
    beyond = (along - np.quantile(along, cut)) / (EDGE * _length(points))
    return Place("side", 1.0 / (1.0 + np.exp(-np.clip(beyond, -40, 40))), direction)


def _patch(points: Float64[Array, "P 3"], centre: Float64[Array, "3"], radius: float) -> Place:
    apart = np.linalg.norm(points - centre, axis=1)
    return Place("patch", np.exp(-0.5 * (apart / (radius * _length(points))) ** 2), centre)
