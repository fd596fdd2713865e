"""How noisy an observation is."""

import math

import numpy as np
from scipy.spatial import cKDTree

from model.gap.bodies.first import first_places
from model.types import Observation

NEIGHBOURS = 6
MIDDLE = 1.5382
"""Median length of a vector of three independent normal numbers of variance 1."""
QUIETEST = 5e-5
"""No measurement is less noisy than this [m]."""


def noise_of(observation: Observation) -> float:
    """Standard deviation of the measured places [m], from third differences in time, less the neighbours'.

    Motion that is smooth over four frames, or that neighbours share, drops out; of independent noise is left
    √20 times as much, and a little more for the neighbours'.
    """
    points = observation.points.astype(np.float64)
    if len(points) < 4:
        return QUIETEST
    third = np.diff(points, n=3, axis=0)
    count = min(NEIGHBOURS, points.shape[1] - 1)
    if count > 1:
        places = np.nan_to_num(first_places(observation), nan=1e3)
        near = cKDTree(places).query(places, k=count + 1)[1][:, 1:]
        third = third - third[:, near].mean(2)
    excess = 20.0 * (1.0 + (1.0 / count if count > 1 else 0.0))
    length = np.linalg.norm(third, axis=-1)  # the same in a turned world, as no coordinate's is
    spread = float(np.nanmedian(length)) if np.isfinite(length).any() else 0.0
    return max(spread / MIDDLE / math.sqrt(excess), QUIETEST)
