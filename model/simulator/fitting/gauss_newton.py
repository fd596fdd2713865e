"""Bounded Gauss-Newton for a few unknowns, its slopes by finite differences."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.optimize import least_squares

from model.simulator.fitting.minimise import (
    ROUNDING,
    Descent,
    Goal,
    Outcome,
    Point,
    Tell,
    Vector,
    judge,
    pushing,
    untold,
)

STEP = 1e-2
"""Of a coordinate, for a difference: wide enough to look across the steps that contacts make in a loss."""
ALONE = 1.0 / 3.0
"""What a rollout without gradient costs, in evaluations of loss and gradient; measured: less."""

SMALLEST = 1e-5
"""Steps below this share of where they begin end the search."""

Residuals: TypeAlias = Callable[[Vector], Float64[np.ndarray, " m"] | None]
"""None: they are not finite there."""


def gauss_newton(
    residuals: Residuals,
    start: Vector,
    low: Vector,
    high: Vector,
    goal: Goal,
    count: int,
    tell: Tell = untold,
) -> Descent:
    """Minimise the mean square of residuals between bounds, in a trust region.

    Slopes are central differences: two rollouts for each unknown, no gradient. They see through what reverse
    differentiation of a rollout with contacts gets wrong: that the time of an impact moves, too.

    Args:
        residuals: What is to be small.
        start: Coordinates to begin at.
        low: Their lower bounds.
        high: Their upper bounds.
        goal: When to stop; its budget counts a rollout alone as `ALONE`.
        count: By how much the sum of squares is divided.
        tell: Called after each rollout of a new place with its loss and the cost so far.

    Reference:
        Branch, Coleman and Li (1999), A subspace, interior, and conjugate gradient method for large-scale
        bound-constrained minimization problems, SIAM J. Sci. Comput. 21 (as scipy has it).
    """
    search = _Search(residuals, low, high, goal, count, tell)
    first = search.look(np.clip(start, low, high))
    if first is None:
        return Descent(None, search.cost, search.rejected, "diverged")
    try:
        least_squares(
            search.ask,
            np.clip(start, low, high),
            jac=search.slopes,
            bounds=(low, high),
            ftol=None,
            xtol=SMALLEST,
            gtol=None,
            max_nfev=10 * int(goal.budget / ALONE + 10),
        )
    except _Spent:
        search.outcome = "budget"
    except _Done:
        pass  # the search has said why
    return Descent(search.best(), search.cost, search.rejected, search.outcome or "stalled")


class _Spent(Exception):
    """No evaluation is left."""


class _Done(Exception):
    """It is good enough."""


class _Search:
    """What a minimisation keeps between the calls of scipy."""

    def __init__(
        self,
        residuals: Residuals,
        low: Vector,
        high: Vector,
        goal: Goal,
        count: int,
        tell: Tell,
    ) -> None:
        self._residuals, self._low, self._high = residuals, low, high
        self._goal, self._count, self._tell = goal, count, tell
        self.cost, self.rejected = 0.0, 0
        self.outcome: Outcome | None = None
        self._losses: list[float] = []
        self._least: tuple[Vector, Float64[np.ndarray, " m"]] | None = None
        self._known: list[Point] = []
        self._size = 0

    def look(self, z: Vector) -> Float64[np.ndarray, " m"] | None:
        """Residuals of a new place."""
        found = self._roll(z)
        loss = np.inf if found is None else self._loss(found)
        self._tell(loss, self.cost)
        if found is None:
            self.rejected += 1
            return None
        self._size = len(found)
        if self._least is None or loss < self._loss(self._least[1]):
            self._least = (z.copy(), found)
        return found

    def ask(self, z: Vector) -> Float64[np.ndarray, " m"]:
        """The same, as scipy wants it."""
        if self._least is not None and np.array_equal(z, self._least[0]):
            return self._least[1]
        found = self.look(z)
        return np.full(self._size, np.inf) if found is None else found

    def slopes(self, z: Vector) -> Float64[np.ndarray, "m n"]:
        """The Jacobian at a place that was accepted; ends the search when that is good enough."""
        found = self.ask(z)
        jacobian = differences(self._roll, z, self._low, self._high, self._size)
        gradient = 2 * jacobian.T @ found / self._count
        free = ~pushing(z, gradient, self._low, self._high)
        step = np.linalg.lstsq(jacobian[:, free], found, rcond=None)[0]
        gain = float(np.sum((jacobian[:, free] @ step) ** 2)) / max(
            float(found @ found), np.finfo(float).tiny
        )
        point = Point(z.copy(), self._loss(found), gradient, gain)
        self._known.append(point)
        self._losses.append(point.loss)
        self.outcome = judge(point, self._losses, self._goal)
        if self.outcome is not None:
            raise _Done
        return jacobian

    def best(self) -> Point:
        """The lowest place; its gradient is the last that was asked for."""
        assert self._least is not None
        z, found = self._least
        if self._known and np.array_equal(self._known[-1].z, z):
            return self._known[-1]
        last = self._known[-1].gradient if self._known else np.zeros(len(z))
        return Point(z, self._loss(found), last, np.inf)

    def _roll(self, z: Vector) -> Float64[np.ndarray, " m"] | None:
        if self.cost + ALONE > self._goal.budget + ROUNDING:
            raise _Spent
        self.cost += ALONE
        return self._residuals(z)

    def _loss(self, residuals: Float64[np.ndarray, " m"]) -> float:
        return float(residuals @ residuals) / self._count


def differences(
    residuals: Residuals, z: Vector, low: Vector, high: Vector, size: int
) -> Float64[np.ndarray, "m n"]:
    """The Jacobian of residuals by central differences, within the bounds."""
    columns = []
    for number in range(len(z)):
        ahead, behind = z.copy(), z.copy()
        ahead[number] = min(z[number] + STEP, high[number])
        behind[number] = max(z[number] - STEP, low[number])
        above, below = residuals(ahead), residuals(behind)
        wide = ahead[number] - behind[number]
        known = above is not None and below is not None and wide > 0
        columns.append((above - below) / wide if known else np.zeros(size))  # type: ignore[operator]
    return np.stack(columns, 1)
