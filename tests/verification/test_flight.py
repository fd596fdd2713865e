"""Free fall and drag: the discrete solution is known to the last digit."""

import math

import pytest
import torch

from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.simulator import Simulator
from model.simulator.system import State


def test_free_fall(points):
    """z_n = z_0 + v_0 n dt - g dt² n(n+1)/2, exactly; so v_0 t - g t²/2 within g t dt/2."""
    system = points([[0.0, 0, 1], [2, 0, 5]], mass=torch.tensor([0.1, 7.0]))
    start = State(system.points, torch.tensor([[0.3, 0, 2.0]] * 2, dtype=torch.float64))
    steps, dt = 200, 1e-3
    end = Simulator(system, [Gravity()]).rollout(start, frames=2, fps=5.0, substeps=steps).end
    moved = end.positions - system.points
    exact = 2.0 * steps * dt - 9.81 * dt**2 * steps * (steps + 1) / 2
    assert moved[:, 2].tolist() == pytest.approx([exact] * 2, rel=1e-12)
    assert moved[:, 0].tolist() == pytest.approx([0.3 * steps * dt] * 2, rel=1e-12)
    assert abs(exact - (2.0 * 0.2 - 9.81 / 2 * 0.2**2)) == pytest.approx(9.81 * 0.2 * dt / 2)


def test_drag_is_exact_whatever_the_step(points):
    """Without other forces v(t) = v_0 exp(-δt) holds for any number of substeps."""
    system = points([[0.0, 0, 0]])
    start = State(system.points, torch.tensor([[1.0, -2.0, 3.0]], dtype=torch.float64))
    for substeps in (1, 7, 50):
        end = Simulator(system, [Drag(3.0)]).rollout(start, frames=2, fps=2.0, substeps=substeps).end
        torch.testing.assert_close(end.velocities, start.velocities * math.exp(-1.5), rtol=1e-12, atol=0)


def test_terminal_velocity(points):
    """Falling against drag, v = (g/δ)(1 - exp(-δt)), first order: within δ dt/2 of it, relatively."""
    system, rate = points([[0.0, 0, 0]]), 4.0
    end = Simulator(system, [Gravity(), Drag(rate)]).rollout(frames=2, fps=0.5, substeps=400).end
    exact = -9.81 / rate * (1 - math.exp(-rate * 2.0))
    error = float(end.velocities[0, 2]) / exact - 1
    assert abs(error) < 0.51 * rate * 2.0 / 400
    assert abs(error) > 0.4 * rate * 2.0 / 400  # the split is first order, not better by accident
