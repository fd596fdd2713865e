"""When frames are, and where the controllers are between them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from torch import Tensor

from model.errors import InputError
from model.simulator.system import Anchors


@dataclass(frozen=True)
class Drive:
    """Controllers between two frames: linear in time, so of constant velocity."""

    motion: Float[Tensor, "T *b C 3"] | None
    """[m]; None: nothing is held."""
    frame: int
    """The frame that the interval ends with."""
    interval: float
    """[s]."""
    count: int
    """Substeps of the interval."""

    @property
    def ends(self) -> tuple[Tensor, Tensor] | None:
        """Where the controllers are at the start and at the end [m], [*b, C, 3]."""
        return None if self.motion is None else (self.motion[self.frame - 1], self.motion[self.frame])

    def __call__(self, substep: int) -> Anchors | None:
        """Anchors at the end of `substep` (from 0)."""
        if self.motion is None:
            return None
        before, after = self.motion[self.frame - 1], self.motion[self.frame]
        way = after - before
        return Anchors(before + way * ((substep + 1) / self.count), way / self.interval)


def clock(times: Sequence[float] | np.ndarray | None, frames: int | None, fps: float) -> np.ndarray:
    """Time of each frame [s].

    Raises:
        InputError: neither is given, they contradict each other, or time does not advance.
    """
    if times is None:
        if frames is None:
            raise InputError("how long to roll out is not said: give controls, times or frames")
        if frames < 1 or not (math.isfinite(fps) and fps > 0):
            raise InputError(
                f"{frames} frames at {fps} per second: give at least one frame, and a rate above 0"
            )
        return np.arange(frames, dtype=np.float64) / fps
    given = np.asarray(times, dtype=np.float64)
    if frames is not None and len(given) != frames:
        raise InputError(f"{len(given)} times for {frames} frames: give one time [s] per frame")
    if not len(given) or not np.isfinite(given).all() or not (np.diff(given) > 0).all():
        raise InputError("times must be finite and strictly increasing [s]")
    return given
