"""Fit parameters of a scene to what really moved: over growing horizons, from several starts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from model.errors import InputError
from model.simulator.fitting.covariance import covariance
from model.simulator.fitting.minimise import Vector
from model.simulator.fitting.objective import Apply, Objective
from model.simulator.fitting.plan import Plan
from model.simulator.fitting.result import Fit, Watch
from model.simulator.fitting.run import Run
from model.simulator.fitting.scene import Scene
from model.simulator.fitting.target import Target
from model.simulator.fitting.unknown import Unknown


def fit(
    scene: Scene,
    unknowns: Sequence[Unknown],
    target: Target,
    plan: Plan | None = None,
    *,
    heldout: Target | None = None,
    apply: Apply = Scene.with_values,
    uncertain: bool = False,
    watch: Watch | None = None,
) -> Fit:
    """Find the values of `unknowns` with which `scene` moves most like `target`.

    Each start goes through all horizons of the plan. The result is that of the start that ended lowest.

    Args:
        scene: What is rolled out; all that is not unknown stays as it is.
        unknowns: What to look for; `seek` makes them.
        target: What was seen, in the frames of `scene.times`.
        plan: Horizons, substeps, starts and budget.
        heldout: Seen, too, but only to measure the error on; `Target.split` makes one.
        apply: How values enter the scene; by name, unless the caller knows another way.
        uncertain: Also estimate the covariance of the values: two rollouts for each.
        watch: Called after each evaluation.

    Raises:
        InputError: no unknown, two of one name, or a target whose frames or points are not the scene's.
        SimulationDiverged: no start gives a finite rollout.
    """
    plan = plan or Plan()
    _check(scene, unknowns, target)
    objective = Objective(scene, unknowns, target, apply)
    run = Run(objective, plan, plan.stages(len(scene.times)), watch)
    runs = [run.go(number, start) for number, start in enumerate(_starts(objective, plan))]
    best = min(runs, key=lambda each: each.ended.loss)
    with torch.no_grad():
        fitted = objective.at(torch.from_numpy(best.z))
        points = objective.roll(fitted, replace(best.look, horizon=len(scene.times) - 1)).points
    return Fit(
        values=best.ended.values,
        scene=fitted,
        loss=best.ended.loss,
        error=target.error(points),
        heldout_error=None if heldout is None else heldout.error(points),
        verdict=best.ended.verdict,
        starts=tuple(each.ended for each in runs),
        evaluations=sum(each.ended.history[-1].cost for each in runs),
        covariance=covariance(objective, best.z, best.look) if uncertain else None,
    )


def _check(scene: Scene, unknowns: Sequence[Unknown], target: Target) -> None:
    names = [unknown.name for unknown in unknowns]
    if not names or len(set(names)) < len(names):
        raise InputError(f"unknowns of a fit are {names}: give one or more, each name once")
    if len(target.points) != len(scene.times):
        raise InputError(f"the target has {len(target.points)} frames, the scene {len(scene.times)}")
    count = len(scene.simulator.system.points)
    if target.index is None and target.points.shape[1] != count:
        raise InputError(
            f"the target has {target.points.shape[1]} points and the scene {count}: give the binding of each"
        )
    if target.index is not None and not (0 <= int(target.index.min()) <= int(target.index.max()) < count):
        raise InputError(f"the target is bound to points that the scene has not: it has {count}")


def _starts(objective: Objective, plan: Plan) -> list[Vector]:
    """The given one, then perturbed ones."""
    low, high = objective.limits
    random = np.random.default_rng(plan.seed)
    begin = objective.start
    away = random.normal(0.0, plan.spread, (plan.restarts, len(begin)))
    return [begin, *(np.clip(begin + step, low, high) for step in away)]
