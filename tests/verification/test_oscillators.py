"""One spring: period and damping of the oscillator it makes."""

import math

import numpy as np
import pytest
import torch

from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import State


def stretches(system, forces, stretch, frames, fps, substeps):
    """Length of the one spring minus its rest length, per frame [m]."""
    ends = system.points.clone()
    ends[1, 0] += stretch
    rollout = Simulator(system, forces).rollout(
        State(ends, torch.zeros_like(ends)), frames=frames, fps=fps, substeps=substeps
    )
    length = (rollout.points[:, 1] - rollout.points[:, 0]).norm(dim=-1)
    return (length - system.value("rest_length")).numpy(), rollout.times.numpy()


def test_dumbbell_period(chain):
    """Two masses on a spring swing with ω = √(k/μ); the integrator's own ω is larger by (ω dt)²/24."""
    masses = torch.tensor([0.2, 0.6], dtype=torch.float64)
    system, stiffness = chain(2, 0.1, masses), 60.0
    omega = math.sqrt(stiffness / float(masses.prod() / masses.sum()))
    dt = 0.1 / omega
    stretch, times = stretches(system, [Spring(stiffness)], 0.01, 401, 1 / dt, 1)
    falls = np.flatnonzero((stretch[:-1] > 0) & (stretch[1:] <= 0))
    crossings = times[falls] + dt * stretch[falls] / (stretch[falls] - stretch[falls + 1])
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert len(crossings) > 5
    error = 2 * math.pi / omega / period - 1
    # a crossing is read off a straight line, which costs up to (ω dt)²/16 of a step at each end
    reading = 2 * (omega * dt) ** 2 / 16 * dt / (crossings[-1] - crossings[0])
    assert error == pytest.approx((omega * dt) ** 2 / 24, abs=reading + (omega * dt) ** 4)


@pytest.mark.parametrize("ratio", [0.1, 0.5, 2.0], ids=["light", "half", "over"])
def test_damped_oscillator(chain, ratio):
    """The stretch is that of x'' + 2ζω x' + ω² x = 0, and the error falls with the first power of dt."""
    system, stiffness = chain(2, 1.0, 0.5), 100.0
    reduced = 0.25
    omega = math.sqrt(stiffness / reduced)
    damping = 2 * ratio * omega * reduced
    errors = []
    for substeps in (10, 20, 40):
        stretch, times = stretches(system, [Spring(stiffness), Dashpot(damping)], 0.05, 11, 50.0, substeps)
        root = np.sqrt(complex(ratio**2 - 1))
        plus, minus = omega * (-ratio + root), omega * (-ratio - root)
        exact = (0.05 * (plus * np.exp(minus * times) - minus * np.exp(plus * times)) / (plus - minus)).real
        errors.append(np.abs(stretch - exact).max() / 0.05)
    assert errors[-1] < omega * (1 + 2 * ratio) / 50 / 40
    assert math.log2(errors[1] / errors[2]) == pytest.approx(1.0, abs=0.1)
