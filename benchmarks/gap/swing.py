"""How a beam that is let go swings, by the height of its tip."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.optimize import least_squares

from model.types import Array

SETTLED = 0.1
"""Of the time, at its end: the tip is at rest by then."""
LOOKED_AT = 1.0
"""Seconds in which it swings clearly."""
PERIODS = np.geomspace(0.05, 0.6, 60)
"""That are looked for at first [s]."""


@dataclass(frozen=True)
class Swing:
    """What a textbook asks of it."""

    drop: float
    """How far the tip is lower at rest [m]."""
    period: float
    """[s]."""
    damping: float
    """Of critical."""


def swing(times: Float64[Array, " T"], height: Float64[Array, " T"]) -> Swing:
    """Drop, period and damping, these by a damped cosine through the first second.

    Args:
        times: From when it is let go [s].
        height: Of the tip [m].
    """
    rest = float(height[-max(1, round(SETTLED * len(height))) :].mean())
    drop = float(height[0]) - rest
    early = times - times[0] <= LOOKED_AT
    since, seen = times[early] - times[0], (height[early] - rest) / max(abs(drop), 1e-9)

    def waves(at: Float64[Array, "2"]) -> Float64[Array, "t 3"]:
        """Cosine, sine and an offset, of period and damping (logarithms)."""
        phase = 2.0 * np.pi * since / np.exp(at[0])
        fading = np.exp(-np.exp(at[1]) * phase)
        return np.stack([fading * np.cos(phase), fading * np.sin(phase), np.ones_like(phase)], -1)

    def left(at: Float64[Array, "2"]) -> Float64[Array, " t"]:
        """What the best of these waves leaves."""
        matrix = waves(at)
        residual: Float64[Array, " t"] = matrix @ np.linalg.lstsq(matrix, seen, rcond=None)[0] - seen
        return residual

    starts = [np.array([np.log(period), np.log(0.05)]) for period in PERIODS]
    begin = min(starts, key=lambda start: float((left(start) ** 2).sum()))
    period, slope = (float(value) for value in np.exp(least_squares(left, begin).x))
    return Swing(drop, period, slope / float(np.hypot(1.0, slope)))
