"""Whether a hand leads what is seen: then something that is not seen is between them."""

import numpy as np
from jaxtyping import Float, Float64

from model.types import Array

STRETCHED = 1.3
"""Times as far as at first that what is led is from its hand at most: soft things stretch."""
NOISE = 0.005
"""And this much farther [m]: of what sensors see, and of where hands are taken to be."""
MOSTLY = 0.95
"""Share of what was seen for which that has to hold: tracks jump."""


def leads(hand: Float64[Array, "T 3"], points: Float[Array, "T N 3"], gap: float) -> bool:
    """Whether points stay as near to a hand as they were at first, though it moves, or they do about it.

    What is held by an end that nobody sees does that; what lies near a hand by chance is left behind. Where
    nothing moves by more than the gap neither can be told.

    Args:
        hand: Where it is [m].
        points: Seen near the end that it may hold [m]; NaN where they are not.
        gap: From the hand to that end in the first frame [m].
    """
    arm = points.astype(np.float64) - hand[:, None]
    known = np.isfinite(arm).all(-1)
    arm, known = arm[:, known.any(0)], known[:, known.any(0)]
    if not known.any():
        return False
    begun = arm[known.argmax(0), np.arange(arm.shape[1])]
    farthest = STRETCHED * np.maximum(np.linalg.norm(begun, axis=-1), gap) + NOISE
    stay = (np.linalg.norm(arm, axis=-1) <= farthest)[known]
    turned = np.linalg.norm(arm - begun, axis=-1)[known].max()
    moved = np.linalg.norm(hand - hand[0], axis=-1).max()
    return bool(stay.mean() >= MOSTLY and max(moved, turned) > gap)
