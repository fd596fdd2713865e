"""What of an object no hand is near."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from model.gap.size import size_of
from model.types import Array, Observation

UNHELD = 0.2
"""Share of the object's size from which on a hand is far."""


def unheld(observation: Observation, places: Float64[Array, "N 3"]) -> Bool[Array, " N"]:
    """Which places on an object are far from all hands in the first frame.

    Args:
        observation: Whose hands count.
        places: Points on the object [m].
    """
    hands = observation.controllers[0].astype(np.float64)
    if not len(hands):
        return np.ones(len(places), bool)
    far: Bool[Array, " N"] = cKDTree(hands).query(places)[0] > UNHELD * size_of(places)
    return far
