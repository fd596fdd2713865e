import pytest
import torch

from model.evaluation.baselines.hardening import HardeningSpring
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import State, System


def _simulator(force):
    points = torch.tensor([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], dtype=torch.float64)
    system = System(points=points, mass=torch.ones(2), springs=torch.tensor([[0, 1]]), rest_length=0.1)
    return Simulator(system, [force], backend="auto"), points


@pytest.mark.parametrize("length", [0.05, 0.12, 0.3])
def test_it_pulls_as_its_law_says(length):
    simulator, points = _simulator(HardeningSpring(20.0))
    points[1, 0] = length
    after = simulator.step(State(points, torch.zeros_like(points)), None, 1e-4)
    force = 20.0 * (length - 0.1) * (1.0 + abs(length / 0.1 - 1.0)) ** 0.5
    assert float(after.velocities[0, 0]) == pytest.approx(force * 1e-4)
    assert float(after.velocities[1, 0]) == pytest.approx(-force * 1e-4)


def test_a_kernel_can_be_had_and_agrees_with_torch():
    start = torch.tensor([[0.0, 0.0, 0.0], [0.16, 0.01, 0.0]], dtype=torch.float64)
    ways = []
    for backend in ("kernel", "torch"):
        simulator, _ = _simulator(HardeningSpring(200.0))
        state = State(start, torch.zeros_like(start))
        rollout = simulator.with_backend(backend).rollout(state, frames=4, substeps=40)
        ways.append(rollout.points)
    assert torch.allclose(ways[0], ways[1], atol=1e-7)


def test_it_is_harder_than_the_linear_spring():
    ends = []
    for force in (HardeningSpring(200.0), Spring(200.0)):
        simulator, points = _simulator(force)
        points[1, 0] = 0.2
        ends.append(simulator.step(State(points, torch.zeros_like(points)), None, 1e-4).velocities[0, 0])
    assert ends[0] > 1.3 * ends[1]
