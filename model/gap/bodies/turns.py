"""Rotations by which points go from some places to others."""

import numpy as np
from jaxtyping import Float64

from model.types import Array


def nearest_rotation(spread: Float64[Array, "*b 3 3"]) -> Float64[Array, "*b 3 3"]:
    """The rotation nearest to each matrix: of sums of products of places before and after, how they turned.

    Reference:
        Kabsch (1976), A solution for the best rotation to relate two sets of vectors, Acta
        Crystallographica A 32.
    """
    left, _, right = np.linalg.svd(spread)
    left[..., -1] *= np.sign(np.linalg.det(left @ right))[..., None]
    turns: Float64[Array, "*b 3 3"] = left @ right
    return turns
