"""Bounded L-BFGS that counts, survives what cannot be evaluated, and says why it stopped."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import OptimizeResult, minimize

Vector: TypeAlias = Float64[np.ndarray, " n"]
Outcome: TypeAlias = Literal["converged", "stalled", "budget", "diverged"]

CORRECTIONS = 20
"""Pairs of steps and gradients from which curvature is guessed."""
WINDOW = 3
"""Iterations over which a decrease is judged."""
ROUNDING = 1e-9
"""Of budgets that are sums of thirds."""
EDGE = 1e-3
"""How near a bound a coordinate is at it."""


@dataclass(frozen=True)
class Point:
    """A place where the loss is known."""

    z: Vector
    loss: float
    gradient: Vector
    left: float
    """By which share the loss may still fall: as far as curvature is known, or per unit of the steepest
    coordinate; what only pushes against a bound does not count."""


Evaluate: TypeAlias = Callable[[Vector], tuple[float, Vector] | None]
"""Loss and gradient; None: the loss is not finite there, or has no finite gradient."""


Tell: TypeAlias = Callable[[float, float], None]
"""Called after each evaluation with its loss, infinite where there is none, and the cost so far."""


def untold(loss: float, cost: float) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Descent:
    """How far a minimisation came."""

    best: Point | None
    """None: it could not even begin."""
    cost: float
    """Evaluations of loss and gradient; a rollout without gradient is a third of one."""
    rejected: int
    """Evaluations that came to nothing."""
    outcome: Outcome


@dataclass(frozen=True)
class Goal:
    """When to stop."""

    budget: float
    """Evaluations."""
    left: float
    """Converged: the loss may still fall by no more than this share."""
    decrease: float
    """Stalled: the loss fell by less than this share in the last iterations."""
    floor: float = 0.0
    """Converged: the loss is below."""


def minimise(
    evaluate: Evaluate, start: Vector, low: Vector, high: Vector, goal: Goal, tell: Tell = untold
) -> Descent:
    """Minimise between bounds by L-BFGS-B.

    A step to where nothing can be evaluated is rejected: the line search is told of a loss that rises from
    the last accepted place as steeply as it was to fall, and tries about a quarter of the step.

    Reference:
        Byrd, Lu, Nocedal and Zhu (1995), A limited memory algorithm for bound constrained optimization, SIAM
        J. Sci. Comput. 16 (as scipy has it).
    """
    search = _Search(evaluate, low, high, goal, tell)
    try:
        begin = search.begin(np.clip(start, low, high))
        if begin is not None and search.outcome is None:
            minimize(
                search.ask,
                begin.z,
                jac=True,
                method="L-BFGS-B",
                bounds=np.stack([low, high], 1),
                callback=search.accept,
                options={
                    "maxcor": CORRECTIONS,
                    "ftol": 0.0,
                    "gtol": 0.0,
                    "maxfun": int(10 * goal.budget + 100),
                    "maxiter": int(10 * goal.budget + 100),
                },
            )
    except _Spent:
        search.outcome = "budget"
    if search.best is None:
        return Descent(None, search.evaluations, search.rejected, "diverged")
    return Descent(search.best, search.evaluations, search.rejected, search.outcome or "stalled")


def pushing(z: Vector, gradient: Vector, low: Vector, high: Vector) -> Bool[np.ndarray, " n"]:
    """Which coordinates are at a bound that keeps the loss from falling further."""
    pushes: Bool[np.ndarray, " n"] = ((z <= low + EDGE) & (gradient > 0)) | (
        (z >= high - EDGE) & (gradient < 0)
    )
    return pushes


def judge(point: Point, losses: Sequence[float], goal: Goal) -> Outcome | None:
    """Whether to stop at a place, after iterations with these losses, its own the last."""
    if point.left <= goal.left or point.loss <= goal.floor:
        return "converged"
    if len(losses) > WINDOW and losses[-1 - WINDOW] - point.loss <= goal.decrease * losses[-1 - WINDOW]:
        return "stalled"
    return None


class _Spent(Exception):
    """No evaluation is left."""


class _Search:
    """What a minimisation keeps between the calls of scipy."""

    def __init__(self, evaluate: Evaluate, low: Vector, high: Vector, goal: Goal, tell: Tell) -> None:
        self._evaluate, self._low, self._high = evaluate, low, high
        self._goal, self._tell = goal, tell
        self.evaluations, self.rejected = 0.0, 0
        self.best: Point | None = None
        self.outcome: Outcome | None = None
        self._unit = 1.0
        self._losses: list[float] = []
        self._known: Point | None = None
        self._accepted: Point | None = None

    def begin(self, z: Vector) -> Point | None:
        """Evaluate the start, which sets the unit of the loss."""
        point = self._look(z)
        if point is not None:
            self._accepted = point
            self._unit = max(point.loss, np.finfo(float).tiny)
            self._judge(point)
        return point

    def ask(self, z: Vector) -> tuple[float, Vector]:
        """Loss and gradient, in units of the first loss."""
        assert self._accepted is not None
        here = self._accepted
        if np.array_equal(z, here.z):  # scipy asks again for where it begins
            return here.loss / self._unit, here.gradient / self._unit
        point = self._look(z.copy())
        if point is not None:
            return point.loss / self._unit, point.gradient / self._unit
        way = z - here.z
        fall = abs(float(here.gradient @ way))
        rise = 2 * fall / float(way @ way) * way
        return (here.loss + fall) / self._unit, rise / self._unit

    def accept(self, intermediate_result: OptimizeResult) -> None:
        """Told after each iteration; ends the search when it has done enough."""
        point = self._known
        if point is None or not np.array_equal(point.z, intermediate_result.x):
            return
        self._accepted = point
        self._judge(point)
        if self.outcome is not None:
            raise StopIteration

    def _judge(self, point: Point) -> None:
        self._losses.append(point.loss)
        self.outcome = judge(point, self._losses, self._goal)

    def _look(self, z: Vector) -> Point | None:
        if self.evaluations + 1 > self._goal.budget + ROUNDING:
            raise _Spent
        self.evaluations += 1
        found = self._evaluate(z)
        point = None if found is None else self._point(z, *found)
        self._known = point
        self._tell(np.inf if point is None else point.loss, self.evaluations)
        if point is None:
            self.rejected += 1
        elif self.best is None or point.loss < self.best.loss:
            self.best = point
        return point

    def _point(self, z: Vector, loss: float, gradient: Vector) -> Point:
        free = np.where(pushing(z, gradient, self._low, self._high), 0.0, gradient)
        steepest = float(np.abs(free).max(initial=0.0))
        return Point(z.copy(), loss, gradient, steepest / max(loss, np.finfo(float).tiny))
