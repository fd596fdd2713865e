"""Whether two recordings of an object show the same points, in the same order."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.gap.bodies.first import first_places
from model.types import Array, Observation

NEIGHBOURS = 4
OTHER = 2.0
"""Neighbours that are so many times as far apart in another recording, or as near, are not the same points:
half of all are, where points were tracked anew, in another order, or on another object."""
FEWEST = 3
"""Points that are seen in both; fewer tell nothing."""


def same_points(observation: Observation, other: Observation) -> bool:
    """Whether as many points were tracked, and neighbours of one recording are as near in the other.

    Args:
        observation: One recording.
        other: Another.
    """
    if observation.points.shape[1] != other.points.shape[1]:
        return False
    before, after = first_places(observation), first_places(other)
    both = np.isfinite(before[:, 0]) & np.isfinite(after[:, 0])
    if both.sum() < FEWEST:
        return False
    ratio = _farther(before[both], after[both])
    return bool(np.median(np.abs(np.log(ratio))) <= np.log(OTHER))


def _farther(here: Float64[Array, "n 3"], there: Float64[Array, "n 3"]) -> Float64[Array, " k"]:
    """How many times as far apart neighbours of one recording are in the other."""
    near = cKDTree(here).query(here, k=min(NEIGHBOURS + 1, len(here)))[1][:, 1:]
    apart = [np.linalg.norm(each[near] - each[:, None], axis=-1).ravel() for each in (here, there)]
    least = 1e-3 * max(float(np.median(apart[0])), 1e-9)
    ratio: Float64[Array, " k"] = np.maximum(apart[1], least) / np.maximum(apart[0], least)
    return ratio
