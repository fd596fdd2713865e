"""How far anything goes that a hand moves: a rollout that goes farther has diverged, though it is finite."""

import numpy as np
from jaxtyping import Float

from model.types import Array

ROOM = 10.0
"""No hand moves anything farther from where it lay [m]."""


def farthest(moved: Float[Array, "T N 3"], rest: Float[Array, "N 3"]) -> Float[Array, " T"]:
    """Of each frame, how far the point is that is farthest from where it lay [m]; 0 where none is known."""
    away = np.linalg.norm(moved.astype(np.float64) - rest, axis=-1)
    most: Float[Array, " T"] = np.where(np.isnan(away), 0.0, away).max(axis=1)
    return most


def left_the_room(moved: Float[Array, "T N 3"], rest: Float[Array, "N 3"]) -> bool:
    """Whether anything got farther than `ROOM`."""
    return bool((farthest(moved, rest) > ROOM).any())
