"""Fit the parameters of a world to what an observer sees, over growing horizons."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float64
from scipy.optimize import OptimizeResult, least_squares

from model.gap.belief import Belief
from model.gap.misfit import STEPS, Misfit, Residuals, Span
from model.types import Array

FIRST_HORIZON = 5
"""Frames."""
TRIALS = 3
"""Places tried for a step, shorter while they lead uphill: each costs far less than the slopes do."""


@dataclass(frozen=True)
class Estimate:
    """What a fit found."""

    values: dict[str, float]
    vector: Float64[Array, " d"]
    residuals: Float64[Array, " m"]
    """Innovations over their noise."""
    jacobian: Float64[Array, "m d"]
    evaluations: int
    belief: Belief
    """What was believed beside the residuals."""

    @property
    def cost(self) -> float:
        """Mean square of the residuals: 1 where only noise is left."""
        return float(np.mean(self.residuals**2))


def estimate(
    misfit: Misfit,
    starts: Float64[Array, "s d"],
    steps: int,
    shortest: int = FIRST_HORIZON,
    *,
    slopes: bool = True,
) -> Estimate:
    """The best of several starts, followed to its minimum over a growing horizon.

    Soft bodies that swing are nearly chaotic: over a long horizon the misfit is rough and its valleys narrow.
    Over a few frames it is smooth, and each longer horizon starts where the last one ended; the whole one
    where the first began, if that leaves less there.

    Args:
        misfit: What is to be small.
        starts: Where to begin; all are looked at, the best is followed.
        steps: Gauss-Newton steps at most for each horizon; each costs one rollout per coordinate, and one.
            The first only looks at the slopes where the horizon starts.
        shortest: Frames of the first horizon; who starts near the minimum needs no short ones.
        slopes: Where it ends slopes are looked at as well. Without, they are those of the step before.
    """
    spent = 0
    low, high = misfit.coordinates.bounds
    inside = np.clip(starts, low + 1e-6, high - 1e-6)
    vector = begun = inside[0]
    found = belief = None
    for last in _horizons(misfit.span, shortest):
        part = misfit.until(last)
        if found is None and len(inside) > 1:
            vector = begun = inside[int((part(inside) ** 2).mean(1).argmin())]
            part.settle()
        ends = last == misfit.span.last
        left = part(vector[None])[0]
        if ends and found is not None:
            before = part(begun[None])[0]
            if (before**2).mean() < (left**2).mean():
                vector, left = begun, before
        belief = part.belief(left, starts[0])
        found = descended(part, vector, left, belief, steps, slopes=slopes and ends)
        vector = np.clip(found.x, low + 1e-6, high - 1e-6)
        if slopes and ends:
            own = slice(-len(vector))
            found.jac[own] = part.renewed(found.x, found.jac[own])
        spent += part.evaluations
    assert found is not None
    assert belief is not None
    count = len(found.fun) - len(vector)
    return Estimate(
        misfit.coordinates.values(found.x),
        found.x,
        found.fun[:count],
        found.jac[:count],
        spent,
        belief,
    )


def _horizons(span: Span, frames: int) -> list[int]:
    """Last frames, each twice as far as the one before."""
    whole = span.last - span.first
    horizons = []
    while frames < 0.75 * whole:
        horizons.append(span.first + frames)
        frames *= 2
    return [*horizons, span.last]


def descended(
    misfit: Residuals,
    vector: Float64[Array, " d"],
    left: Float64[Array, " m"],
    belief: Belief,
    steps: int,
    *,
    slopes: bool = True,
) -> OptimizeResult:
    """Gauss-Newton with wide differences, then with fine ones.

    What the frames so far say nothing of stays near what is believed.

    Args:
        misfit: What is to be small.
        vector: Where to begin, within the bounds.
        left: The residuals there.
        belief: Of its coordinates, beside that.
        steps: At most; the first only looks at the slopes.
        slopes: Are looked at where it ends as well, which costs as much as a step. Without, what is returned
            has those of the step before.

    Returns:
        Of `scipy.optimize.least_squares`; the last residuals, one a coordinate, are of what is believed.
    """

    def residuals(at: Float64[Array, " d"]) -> Float64[Array, " r"]:
        seen = left if np.array_equal(at, vector) else misfit(at[None])[0]
        return np.concatenate([seen, belief.residuals(at)])

    looked: list[Float64[Array, "r d"]] = []

    def jacobian(at: Float64[Array, " d"], width: float) -> Float64[Array, "r d"]:
        if slopes or len(looked) < max(1, steps - 1):
            looked.append(np.concatenate([misfit.jacobian(at, width), np.diag(belief.weight)]))
        return looked[-1]

    low, high = misfit.bounds
    begin, more, found = vector, steps, None
    for width in STEPS:
        found = least_squares(
            residuals,
            begin,
            partial(jacobian, width=width),
            bounds=(low, high),
            max_nfev=1 + TRIALS * (more - 1),
            xtol=0.05 * width,
            ftol=1e-3,
            callback=_after(more - 1),
        )
        begin, more = np.clip(found.x, low + 1e-6, high - 1e-6), more - found.njev
        if more <= 0:
            break
    return found


def _after(steps: int) -> Callable[[OptimizeResult], None]:
    """Ends a fit that has taken so many steps, however many were tried in vain."""
    taken = 0

    def ended(intermediate_result: OptimizeResult) -> None:
        nonlocal taken
        taken += 1
        if taken >= steps:
            raise StopIteration

    return ended
