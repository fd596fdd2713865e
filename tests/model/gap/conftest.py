"""Small worlds in which every effect has something to act on."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.world import Sight, World
from model.simulator.build import build_simulator
from model.simulator.simulator import Simulator

SPACING = 0.04


@pytest.fixture
def block():
    """A block of 4 × 3 × 3 points, one edge held and carried up, to the side and back; float64."""
    return _block()


@pytest.fixture
def smooth():
    """The same block over a ground that it never meets, so that its motion has a derivative."""
    world = _block()
    simulator = world.simulator
    free = Simulator(simulator.system, [simulator.force(name) for name in simulator.forces])
    return replace(world, simulator=free)


def _block():
    grid = np.stack(np.meshgrid(np.arange(4), np.arange(3), np.arange(3), indexing="ij"), -1).reshape(-1, 3)
    points = SPACING * grid + np.array([0.0, 0.0, 0.002])
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu(apart < 1.8 * SPACING, 1))
    held = np.flatnonzero((grid[:, 0] == 0) & (grid[:, 2] == 2))
    times = np.arange(16) / 30.0
    swing = 0.15 * np.stack([np.sin(8 * times), 0 * times, 1 - np.cos(6 * times)], -1)
    controls = torch.from_numpy(points[held][None] + swing[:, None])
    simulator = build_simulator(
        points=points,
        mass=np.full(len(points), 0.01),
        springs=springs,
        rest_length=apart[springs[:, 0], springs[:, 1]],
        stiffness=20.0,
        controller_springs=np.stack([np.arange(len(held)), held], -1),
        controller_rest_length=np.full(len(held), 1e-3),
        controller_stiffness=60.0,
        controller_points=points[held] + np.array([0.0, 0.0, 1e-3]),
        dashpot_damping=0.02,
        drag_rate=1.0,
        friction=0.4,
        restitution=0.1,
        ground_height=0.0,
        dtype=torch.float64,
    )
    count = len(points)
    sight = Sight(torch.arange(count)[:, None], torch.ones((count, 1), dtype=torch.float64))
    return World(simulator, sight, times, controls, ground_height=0.0)


@pytest.fixture
def loose():
    """Four points that nothing joins, holds or stands under."""
    simulator = build_simulator(
        points=torch.eye(4, 3, dtype=torch.float64),
        mass=1.0,
        springs=torch.zeros((0, 2), dtype=torch.long),
        rest_length=torch.zeros(0),
        stiffness=torch.zeros(0),
        gravity=(0.0, 0.0, 0.0),
        dtype=torch.float64,
    )
    sight = Sight(torch.arange(4)[:, None], torch.ones((4, 1), dtype=torch.float64))
    return World(simulator, sight, np.arange(3) / 30.0)
