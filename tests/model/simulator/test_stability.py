import math

import numpy as np
import pytest
import torch

from model.simulator.dynamics import Dynamics
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.pace import LONGEST, MARGIN, StabilityWarning, substeps_for
from model.simulator.simulator import Simulator
from model.simulator.stability import stable_step
from model.simulator.system import State, System


def exact_step(system, forces, state, anchors):
    """The same bound from dense matrices: bisection on the largest eigenvalue."""
    dynamics = Dynamics(system, forces, [])

    def acceleration(place, speed):
        shape = state.positions.shape
        return dynamics.acceleration(State(place.reshape(shape), speed.reshape(shape)), anchors, 0.0)[
            0
        ].reshape(-1)

    place, speed = state.positions.reshape(-1), state.velocities.reshape(-1)
    stiff, damped = (-m.numpy() for m in torch.autograd.functional.jacobian(acceleration, (place, speed)))
    low, high = 1e-8, 10.0
    for _ in range(80):
        dt = math.sqrt(low * high)
        largest = np.linalg.eigvals(dt**2 * stiff + 2 * dt * damped).real.max()
        low, high = (low, dt) if largest > 4 else (dt, high)
    return low


@pytest.mark.parametrize("damper", [Dashpot, UnprojectedDashpot])
@pytest.mark.parametrize("damping", [0.0, 0.5, 50.0], ids=["undamped", "mixed", "overdamped"])
def test_agrees_with_dense_eigenvalues(system, state, anchors, damper, damping):
    forces = [Spring(1000.0), ControllerSpring(3000.0), damper(damping), Gravity()]
    found = stable_step(Dynamics(system, forces, []), state, anchors)
    assert found == pytest.approx(exact_step(system, forces, state, anchors), rel=0.02)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.3, 0.1, 0.05, 0.01])
def test_a_spring_that_is_pressed_together_hides_no_stiff_one(share):
    """Across its axis it pushes away, by k (L/d - 1), which is far more than another is stiff."""
    places = torch.tensor([[0, 0, 0], [0.1, 0, 0], [0, 1, 0], [0.1 * share, 1, 0]], dtype=torch.float64)
    system = System(
        points=places,
        mass=torch.full((4,), 0.01, dtype=torch.float64),
        springs=torch.tensor([[0, 1], [2, 3]]),
        rest_length=torch.full((2,), 0.1, dtype=torch.float64),
    )
    dynamics = Dynamics(system, [Spring(torch.tensor([5000.0, 1000.0], dtype=torch.float64))], [])
    found = stable_step(dynamics, State(places, torch.zeros_like(places)), None)
    assert found == pytest.approx(2.0 / math.sqrt(2 * 5000.0 / 0.01), rel=1e-3)


def test_nothing_stiff_has_no_bound(system, state, anchors):
    assert stable_step(Dynamics(system, [Gravity()], []), state, anchors) == math.inf
    assert substeps_for(1 / 30, math.inf, MARGIN) == math.ceil(1 / 30 / LONGEST)


def test_inside_the_bound_stays_and_outside_explodes(system, state):
    simulator = Simulator(system, [Spring(1e7), ControllerSpring(1e7), Dashpot(20.0)])
    needed = simulator.needed_substeps(1 / 30, state)
    assert needed > 1.5 / 30 / LONGEST
    calm = simulator.rollout(state, frames=3)
    assert set(calm.substeps) == {needed}
    with pytest.warns(StabilityWarning, match="stability needs"):
        wild = simulator.rollout(state, frames=2, substeps=int(0.75 * needed / MARGIN))
    excursions = [float((rollout.points - state.positions).abs().max()) for rollout in (calm, wild)]
    assert excursions[0] < 1.0
    assert excursions[1] > 10.0


def test_controller_springs_count(system):
    soft = Simulator(system, [Spring(1e8), ControllerSpring(1e8)]).needed_substeps(1 / 30)
    stiff = Simulator(system, [Spring(1e8), ControllerSpring(1e10)]).needed_substeps(1 / 30)
    assert stiff > 3 * soft


def test_a_grip_without_length_is_stiff_in_all_directions():
    """Three hands hold one point where it is: no edge has a direction, yet each soon pulls all ways."""
    system = System(
        points=torch.tensor([[0.0, 0, 0], [0.1, 0, 0]], dtype=torch.float64),
        mass=1.0,
        springs=torch.tensor([[0, 1]]),
        rest_length=0.1,
        controller_springs=torch.tensor([[0, 0], [1, 0], [2, 0]]),
        controller_rest_length=1e-9,
        controller_points=torch.zeros((3, 3), dtype=torch.float64),
    )
    simulator = Simulator(system, [Spring(1.0), ControllerSpring(1e4)])
    assert simulator.needed_substeps(1.0, margin=1.0) >= 0.98 * (3e4) ** 0.5 / 2
    start = State(system.points, torch.tensor([[0.3, 0.2, -0.1], [0.0, 0, 0]], dtype=torch.float64))
    end = simulator.rollout(start, frames=11, fps=10.0).end
    assert end.velocities.norm() < 0.5


@pytest.mark.parametrize("backend", ["torch", "auto"])
def test_what_is_needed_is_what_a_rollout_takes(backend):
    """Also where a grip has nearly no length: both look where it has a direction."""
    places = torch.tensor([[0.0, 0, 0], [0.1, 0, 0]], dtype=torch.float64)
    system = System(
        points=places,
        mass=1.0,
        springs=torch.tensor([[0, 1]]),
        rest_length=0.1,
        controller_springs=torch.tensor([[0, 0], [1, 0]]),
        controller_rest_length=1e-9,
        controller_points=torch.tensor([[1e-9, 0, 0], [0, 1e-9, 0]], dtype=torch.float64),
    )
    simulator = Simulator(system, [Spring(1.0), ControllerSpring(1e5)], backend=backend)
    assert simulator.needed_substeps(0.1) == simulator.rollout(frames=2, fps=10.0).substeps[0]
    assert simulator.needed_substeps(1.0, margin=1.0) >= 0.98 * (2e5) ** 0.5 / 2
