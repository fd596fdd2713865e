"""What a slow observer sees: a push that is faint but lasts, which a quick one forgives before it goes far.

Fits follow a quick observer, for which a misfit is smooth. What acts all the time, a tilt, a wind, a weight
too much, moves a body by centimetres, of which one that forgets an error within 0.15 s sees millimetres. A
slow one sees most of it; and what it sees no fit has made small, so a wrong effect seldom explains it.
"""

import numpy as np
from jaxtyping import Float64

from model.gap.account import e_folds
from model.gap.misfit import Misfit, Span
from model.types import Array

SLOW = 0.6
"""Patience of the slow observer [s]."""
BLOCKS = 8
"""Of time, each of which counts alike: what explains one fall does not explain a recording."""


def left_slowly(misfit: Misfit, values: dict[str, float]) -> Float64[Array, " k"]:
    """Mean squares of what a slow observer finds wrong in blocks of time, over the noise.

    Args:
        misfit: Of a hypothesis, as it was fitted; all frames of its recording are looked at.
        values: Of its quantities.
    """
    observer, span = (
        misfit.observer.forgetting(SLOW),
        Span(0, len(misfit.observer.seen) - 1, misfit.span.state),
    )
    slow = misfit.through(observer, span)
    residuals = slow(misfit.coordinates.vector(values)[None])[0]
    block = slow.frame_of_residuals() * BLOCKS // (slow.span.last + 1)
    return np.array([np.mean(residuals[block == one] ** 2) for one in np.unique(block)])


def explained_slowly(without: Float64[Array, " k"], with_it: Float64[Array, " k"]) -> float:
    """How many times less is left with an effect, as a logarithm, on average over blocks of time."""
    return float(np.mean(e_folds(without, with_it)))
