"""Zigzags die out at the rate that was asked for, long waves hardly, rigid motions not at all."""

import numpy as np
import pytest
import torch

from model.simulator.build import build_simulator
from model.simulator.dynamics import Dynamics
from model.simulator.forces.bending_damping import BendingDamping
from model.simulator.system import State

COUNT, APART, MASS, DECAY = 40, 0.01, 0.2, 50.0


@pytest.fixture
def chain():
    """A straight chain of points that only resists how fast it bends; its forces at velocities [m/s]."""
    points = np.stack([APART * np.arange(COUNT), np.zeros(COUNT), np.zeros(COUNT)], -1)
    springs = np.stack([np.arange(COUNT - 1), np.arange(1, COUNT)], -1)
    term = BendingDamping.calming(points, springs, MASS, DECAY)
    simulator = build_simulator(
        points=points,
        mass=np.full(COUNT, MASS / COUNT),
        springs=springs,
        rest_length=np.full(COUNT - 1, APART),
        stiffness=np.full(COUNT - 1, 1e-6),
        dtype=torch.float64,
    )

    def force(velocities, places=points):
        dynamics = Dynamics(simulator.system, [term], [])
        state = State(torch.from_numpy(places), torch.from_numpy(velocities))
        return term.force(dynamics.motion(state, None), dynamics.forces[0][1]).numpy()

    return points, force


@pytest.mark.parametrize("points_a_wave", [2, 4, 8, 20])
def test_a_wave_dies_out_at_its_share_of_the_rate(chain, points_a_wave):
    _, force = chain
    wave = np.zeros((COUNT, 3))
    wave[:, 2] = np.cos(2 * np.pi * np.arange(COUNT) / points_a_wave)
    inner = slice(4, -4)  # ends have fewer rows
    slowed = -force(wave)[inner, 2] / (MASS / COUNT)
    expected = DECAY * np.sin(np.pi / points_a_wave) ** 4 * wave[inner, 2]
    np.testing.assert_allclose(slowed, expected, atol=1e-9 * DECAY)


def test_what_moves_or_turns_as_a_whole_is_not_resisted(chain):
    points, force = chain
    turning = np.cross(np.array([0.0, 3.0, -2.0]), points) + np.array([0.3, -0.1, 0.5])
    assert np.abs(force(turning)).max() < 1e-12
    bent = points.copy()
    bent[:, 2] = 0.05 * np.sin(points[:, 0] / 0.05)  # in a plane, about its normal
    assert np.abs(force(np.cross(np.array([0.0, 3.0, 0.0]), bent), bent)).max() < 1e-12


def test_a_twin_that_fades_keeps_its_long_waves():
    """A chain pressed together by 2 % stays straight for longer, and swings on when it is pulled."""
    points = np.stack([APART * np.arange(COUNT), np.zeros(COUNT), np.zeros(COUNT)], -1)
    springs = np.stack([np.arange(COUNT - 1), np.arange(1, COUNT)], -1)

    def moved(stretch, shape, decay):
        places = points.copy()
        places[:, 2] += shape
        simulator = build_simulator(
            points=places,
            mass=np.full(COUNT, MASS / COUNT),
            springs=springs,
            rest_length=np.full(COUNT - 1, APART / stretch),
            stiffness=np.full(COUNT - 1, 1000.0),
            controller_springs=np.array([[0, 0], [1, COUNT - 1]]),
            controller_rest_length=np.zeros(2),
            controller_stiffness=np.full(2, 1e4),
            controller_points=places[[0, -1]],
            gravity=(0.0, 0.0, 0.0),
            bending_decay=decay,
            dtype=torch.float64,
        )
        times = np.arange(7) / 30.0
        held = torch.from_numpy(places[[0, -1]])[None].expand(7, -1, -1)
        return simulator.rollout(None, held, times=times).points.numpy()[..., 2]

    zigzag = 1e-6 * (-1.0) ** np.arange(COUNT)
    free, calmed = (np.abs(moved(0.98, zigzag, decay)[3]).max() for decay in (0.0, 1000.0))
    assert calmed < 0.02 * free
    swing = 1e-3 * np.sin(np.pi * np.arange(COUNT) / (COUNT - 1))
    free, calmed = (moved(1.05, swing, decay) for decay in (0.0, 1000.0))
    np.testing.assert_allclose(calmed, free, atol=1e-4)
