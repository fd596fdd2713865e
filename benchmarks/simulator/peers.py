"""What other simulators contribute to the table of times: Warp's spring kernels, Newton and MuJoCo."""

from collections.abc import Callable

import numpy as np
import warp as wp
from kernel_warp import WarpSprings
from peers_mujoco import MujocoSprings
from peers_newton import NewtonSprings

from model.simulator.simulator import Simulator

NAMES = ("Warp", "Newton", "MuJoCo")
STEPS = {"Warp": 20, "Newton": 20, "MuJoCo": 5}
"""Substeps of one run."""


def peers(simulator: Simulator, dt: float, gradients: bool) -> dict[str, Callable[[], object]]:
    """STEPS substeps of `dt` [s] from rest by each peer that has them: MuJoCo has no gradient of a step.

    Newton has no drag and no ground, and MuJoCo is spared the search for contacts: they do less than we do.
    """
    runs: dict[str, Callable[[], object]] = {"Warp": WarpSprings(simulator, dt, STEPS["Warp"], gradients).run}
    weights = np.ones(simulator.system.points.shape) if gradients else None
    graph = NewtonSprings(simulator, dt, gradients).replay(STEPS["Newton"], weights)
    runs["Newton"] = lambda: wp.capture_launch(graph)
    if not gradients:
        runs["MuJoCo"] = _mujoco(simulator, dt)
    return runs


def _mujoco(simulator: Simulator, dt: float) -> Callable[[], object]:
    forces = [simulator.force(name) for name in simulator.forces]
    springs = MujocoSprings(Simulator(simulator.system, forces, (), simulator.integrator, "torch"), dt)
    still = np.zeros((springs.count, 3))

    def run() -> None:
        springs.set(springs.rest, still)
        for _ in range(STEPS["MuJoCo"]):
            springs.step()

    return run
