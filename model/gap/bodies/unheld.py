"""What of an object no hand is near, and what does not lie on the ground."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from model.gap.size import size_of
from model.types import Array, Observation

UNHELD = 0.2
"""Share of the object's size from which on a hand is far."""
RAISED = 0.12
"""Off the ground is what is above it by more than such a share of the object's size."""


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


def off_the_ground(places: Float64[Array, "N 3"], ground: float) -> Bool[Array, " N"]:
    """Which places on an object are well above the ground, whose height this is [m].

    Args:
        places: Points on the object [m].
        ground: Height of the ground [m].
    """
    raised: Bool[Array, " N"] = places[:, 2] - ground > RAISED * size_of(places)
    return raised
