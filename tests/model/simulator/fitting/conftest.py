"""Interactions with known parameters, and what a camera would have seen of them."""

import warnings

import numpy as np
import pytest
import torch

from model.simulator.build import build_simulator
from model.simulator.fitting.scene import Scene
from model.simulator.fitting.target import Target
from model.simulator.system import State

FPS = 30.0


def lattice(counts, spacing, reach):
    """Points of a grid, and the pairs of those within reach."""
    points = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), -1).reshape(-1, 3)
    points = points * spacing
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    pairs = np.argwhere(np.triu((apart < reach * spacing) & (apart > 0)))
    return points, pairs, apart[pairs[:, 0], pairs[:, 1]]


@pytest.fixture
def chain():
    """A hanging chain of eight points that starts level and swings; made with the parameters given."""

    def build(stiffness=60.0, damping=0.02, drag=0.5, mass=0.004, frames=11, dtype=torch.float64):
        points, pairs, lengths = lattice((8, 1, 1), 0.03, 1.1)
        simulator = build_simulator(
            points=points,
            mass=np.full(8, mass),
            springs=pairs,
            rest_length=lengths,
            stiffness=stiffness,
            controller_springs=np.array([[0, 0]]),
            controller_rest_length=np.zeros(1),
            controller_stiffness=300.0,
            controller_points=points[:1],
            dashpot_damping=damping,
            drag_rate=drag,
            dtype=dtype,
        )
        return Scene(simulator, np.arange(frames) / FPS)

    return build


@pytest.fixture
def sheet():
    """A sheet held at one edge that falls and flaps."""

    def build(stiffness=40.0, damping=0.02, drag=0.5, frames=9):
        points, pairs, lengths = lattice((5, 4, 1), 0.03, 1.5)
        held = np.arange(4)
        simulator = build_simulator(
            points=points,
            mass=np.full(20, 0.002),
            springs=pairs,
            rest_length=lengths,
            stiffness=stiffness,
            controller_springs=np.stack([held, held], 1),
            controller_rest_length=np.zeros(4),
            controller_stiffness=200.0,
            controller_points=points[held],
            dashpot_damping=damping,
            drag_rate=drag,
            dtype=torch.float64,
        )
        return Scene(simulator, np.arange(frames) / FPS)

    return build


@pytest.fixture
def block():
    """A block thrown on the ground, on which it slides."""

    def build(stiffness=150.0, damping=0.1, friction=0.4, velocity=(0.8, 0.0, -0.5), mass=0.003, frames=8):
        points, pairs, lengths = lattice((3, 3, 3), 0.03, 1.8)
        simulator = build_simulator(
            points=points + np.array([0.0, 0.0, 0.01]),
            mass=np.full(27, mass),
            springs=pairs,
            rest_length=lengths,
            stiffness=stiffness,
            dashpot_damping=damping,
            friction=friction,
            ground_height=0.0,
            dtype=torch.float64,
        )
        rest = simulator.rest_state()
        speed = torch.tensor(velocity, dtype=torch.float64).expand_as(rest.positions)
        return Scene(simulator, np.arange(frames) / FPS, state=State(rest.positions, speed))

    return build


@pytest.fixture
def watched():
    """What a noisy camera sees of a scene that is rolled out finely, a fifth of it hidden."""

    def see(scene, noise=1e-3, hidden=0.2, refine=3, seed=0):
        with torch.no_grad(), warnings.catch_warnings():
            needed = max(scene.rollout(2).substeps)
            points = scene.rollout(substeps=refine * needed).points.double()
        rng = np.random.default_rng(seed)
        seen = points + torch.from_numpy(rng.normal(0.0, max(noise, 1e-300), points.shape))
        seen[torch.from_numpy(rng.random(points.shape[:2]) < hidden)] = torch.nan
        return Target(seen, noise=noise or 1e-3)

    return see
