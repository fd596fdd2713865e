"""How far anything goes that a hand moves: a rollout that goes farther has diverged, though it is finite."""

import numpy as np
from jaxtyping import Float

from model.errors import InputError
from model.types import Array

ROOM = 10.0
"""No hand moves anything farther from where it lay [m]."""


class LeftTheRoom(InputError):
    """A rollout that is finite, and of no world that there is."""

    def __init__(self, frame: int, away: float) -> None:
        """Say it in one line."""
        super().__init__(
            f"the simulation diverged: in frame {frame} a point is {away:.2g} m from where it lay"
        )


def check_near(moved: Float[Array, "T N 3"], rest: Float[Array, "N 3"]) -> None:
    """See that nothing has flown off; what is not known (NaN) has not.

    Raises:
        LeftTheRoom: something got farther than `ROOM`.
    """
    away = np.linalg.norm(moved.astype(np.float64) - rest, axis=-1)
    gone = away > ROOM
    if gone.any():
        frame = int(gone.any(axis=1).argmax())
        raise LeftTheRoom(frame, float(np.nanmax(away[frame])))
