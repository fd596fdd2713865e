"""One start of a fit, through all horizons."""

import math
from dataclasses import dataclass, replace

import numpy as np

from model.simulator.fitting.gauss_newton import gauss_newton
from model.simulator.fitting.minimise import (
    ROUNDING,
    Descent,
    Goal,
    Outcome,
    Point,
    Tell,
    Vector,
    minimise,
    pushing,
)
from model.simulator.fitting.objective import Look, Objective
from model.simulator.fitting.plan import FEW, Plan, Stage
from model.simulator.fitting.result import Ended, StageResult, Step, Verdict, Watch

FLOOR = 1e-4
"""Loss below which there is nothing left to find: residuals of a hundredth of the noise."""
PAYS, STALLS = 1e-2, 1e-6
"""A stage ends when its last iterations lowered the loss by less than this share: on the way; at the end."""
FINER = 2
"""How often the substeps of a stage are doubled before its start is given up as one that diverges."""


@dataclass(frozen=True)
class Ran:
    """Where a start led, and how it was looked at there."""

    ended: Ended
    z: Vector
    look: Look


class Run:
    """Takes starts through the stages of a plan."""

    def __init__(
        self, objective: Objective, plan: Plan, stages: tuple[Stage, ...], watch: Watch | None
    ) -> None:
        """See `fit`."""
        self._objective, self._plan, self._stages, self._watch = objective, plan, stages, watch
        self._low, self._high = objective.limits

    def go(self, number: int, start: Vector) -> Ran:
        """Through all stages from one start, the `number`th."""
        history, results = list[Step](), list[StageResult]()
        place, used = start, 0.0
        point: Point | None = None
        outcome: Outcome = "diverged"
        look = Look(self._stages[-1].horizon, 1, self._plan.checkpoint)
        for index, stage in enumerate(self._stages):
            budget = self._plan.budget(self._stages, index, used)
            if budget < 1 - ROUNDING:
                continue
            begun = len(history)
            descent, look = self._descend(number, stage, place, (used, budget), history)
            used += descent.cost
            point, outcome = descent.best, descent.outcome
            losses = (history[begun].loss, math.inf if point is None else point.loss)
            results.append(
                StageResult(stage, look.substeps, descent.cost, descent.rejected, *losses, descent.outcome)
            )
            if point is None:
                break
            place = point.z
        ended = Ended(
            self._objective.values(start),
            self._objective.values(place),
            math.inf if point is None else point.loss,
            tuple(results),
            tuple(history),
            self._judge(point, outcome),
        )
        return Ran(ended, place, look)

    def _descend(
        self, number: int, stage: Stage, place: Vector, account: tuple[float, float], history: list[Step]
    ) -> tuple[Descent, Look]:
        """One stage, finer where its start diverges. `account`: evaluations used, and those to use."""
        (used, budget), cost, rejected = account, 0.0, 0
        needed = self._objective.substeps(place, stage.refine)
        for finer in range(FINER + 1):
            look = Look(stage.horizon, (needed or 1) * 2**finer, self._plan.checkpoint)
            goal = Goal(budget - cost, self._plan.tolerance, STALLS if stage.last else PAYS, FLOOR)

            def tell(loss: float, own: float, before: float = used + cost) -> None:
                history.append(Step(number, stage.horizon, before + own, loss))
                if self._watch is not None:
                    self._watch(history[-1])

            descent = self._minimise(place, look, goal, tell)
            cost, rejected = cost + descent.cost, rejected + descent.rejected
            if descent.best is not None or budget - cost < 1 or needed is None:
                break
        return replace(descent, cost=cost, rejected=rejected), look

    def _minimise(self, place: Vector, look: Look, goal: Goal, tell: Tell) -> Descent:
        objective, low, high = self._objective, self._low, self._high
        if self._plan.method == "gauss_newton" or (self._plan.method == "auto" and len(place) <= FEW):
            return gauss_newton(
                lambda z: objective.residuals(z, look), place, low, high, goal, objective.count(look), tell
            )
        return minimise(lambda z: objective.evaluate(z, look), place, low, high, goal, tell)

    def _judge(self, point: Point | None, outcome: Outcome) -> Verdict:
        if point is None:
            return Verdict("diverged", math.inf, (), "no rollout from this start is finite")
        tolerance = self._plan.tolerance
        pushed = pushing(point.z, point.gradient, self._low, self._high)
        pushed &= np.abs(point.gradient) > tolerance * point.loss
        names = np.array(self._objective.names())[pushed]
        bounds = tuple(dict.fromkeys(str(name) for name in names))
        if point.left <= tolerance or point.loss <= FLOOR:
            outcome = "converged"
        said = {
            "converged": "converged: there is nothing left to gain",
            "stalled": "stalled: the loss no longer falls, though its slope says that it should",
            "budget": "out of evaluations while the loss still fell",
            "diverged": "no rollout from this start is finite",
        }[outcome]
        held = f"; held back by a bound: {', '.join(bounds)}" if bounds else ""
        return Verdict(outcome, point.left, bounds, said + held)
