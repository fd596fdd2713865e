"""A small scene with everything in it, and terms with constants drawn from their declared ranges."""

import inspect

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from model.simulator.dynamics import Dynamics
from model.simulator.forces.base import spread
from model.simulator.forces.stencil import StencilForce
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State, System

POINTS, CONTROLLERS, STENCILS = 9, 2, 5


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def system(rng):
    """Nine points in general position, every pair within reach joined, two of them held; float64."""
    points = torch.from_numpy(rng.uniform(-0.1, 0.1, (POINTS, 3)))
    apart = torch.cdist(points, points)
    springs = torch.nonzero(torch.triu(apart < 0.16, diagonal=1))
    rest = apart[springs[:, 0], springs[:, 1]] * torch.from_numpy(rng.uniform(0.8, 1.2, len(springs)))
    return System(
        points=points,
        mass=torch.from_numpy(rng.uniform(0.5, 2.0, POINTS)),
        springs=springs,
        rest_length=rest,
        controller_springs=torch.tensor([[0, 2], [1, 5], [1, 6]]),
        controller_rest_length=torch.from_numpy(rng.uniform(0.02, 0.05, 3)),
        controller_points=torch.from_numpy(rng.uniform(-0.1, 0.1, (CONTROLLERS, 3))),
    )


@pytest.fixture
def state(rng, system):
    moved = system.points + torch.from_numpy(rng.normal(0, 0.01, (POINTS, 3)))
    return State(moved, torch.from_numpy(rng.normal(0, 0.5, (POINTS, 3))))


@pytest.fixture
def anchors(rng, system):
    return Anchors(system.controller_points, torch.from_numpy(rng.normal(0, 0.5, (CONTROLLERS, 3))))


@pytest.fixture
def free(system):
    """The same scene, held by nobody."""
    return System(
        points=system.points,
        mass=system.value("mass"),
        springs=system.springs,
        rest_length=system.value("rest_length"),
    )


@pytest.fixture
def far_apart():
    """Twelve points that nothing joins, at rest out of each other's reach."""
    line = torch.arange(12, dtype=torch.float64)[:, None] * torch.ones(3, dtype=torch.float64)
    return System(
        points=line, mass=1.0, springs=torch.zeros((0, 2), dtype=torch.long), rest_length=torch.zeros(0)
    )


@pytest.fixture
def make(rng):
    """Make a term of a class for a system, each constant drawn from the range it declares."""

    def build(kind, system):
        values = {}
        for name, constant in kind.constants.items():
            size = STENCILS if constant.over == "stencils" else system.size(constant.over)
            values[name] = torch.from_numpy(np.asarray(rng.uniform(*constant.range, size or ())))
        given = {"system": system, "distance": 0.06}
        if hasattr(kind, "size"):
            chosen = [rng.permutation(POINTS)[: kind.size] for _ in range(STENCILS)]
            given["stencils"] = torch.from_numpy(np.stack(chosen))
        wanted = inspect.signature(kind.__init__).parameters
        return kind(**values, **{name: value for name, value in given.items() if name in wanted})

    return build


@pytest.fixture
def told():
    """What a term's stencils remember of another shape than that of a state, which turns with the world."""

    def build(term, dynamics, state, anchors=None):
        if not isinstance(term, StencilForce):
            return {}
        middle, count = state.positions.mean(0), len(state.positions)
        larger = 1.0 + 0.1 * torch.sin(torch.arange(count, dtype=middle.dtype)).unsqueeze(-1)
        there = State(middle + larger * (state.positions - middle), state.velocities)
        return term.rest_memory(dynamics.motion(there, anchors), term.values(state.positions))

    return build


@pytest.fixture
def force_of(told):
    """Force [N] of one term on every point of a system."""

    def force(term, system, state, anchors=None):
        dynamics = Dynamics(system, [term], [])
        (_, values) = dynamics.forces[0]
        motion = dynamics.motion(state, anchors)
        if not term.memory or isinstance(term, StencilForce):
            return term.force(motion, {**values, **told(term, dynamics, state, anchors)})
        fresh = dict.fromkeys(term.memory, torch.zeros_like(motion.over(motion.length, term.where)))
        remembered = {
            name: value + torch.linspace(0.01, 0.03, value.numel(), dtype=value.dtype)
            for name, value in fresh.items()
        }
        tension, _ = term.tension(motion, values, remembered, 1e-3)
        pull = tension.unsqueeze(-1) * motion.over(motion.axis, term.where, dim=-2)
        return motion.pull(spread(motion, term.where, pull))

    return force


@pytest.fixture
def rotation():
    return torch.from_numpy(Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix())


@pytest.fixture
def about_vertical():
    return torch.from_numpy(Rotation.from_rotvec([0.0, 0.0, 0.8]).as_matrix())


@pytest.fixture(params=["torch", "auto"])
def backend(request, monkeypatch):
    """Simulators made in the test compute rollouts in plain torch, then as they do by default."""
    initialise = Simulator.__init__

    def made(self, *args, **kwargs):
        if len(args) < 5:
            kwargs.setdefault("backend", request.param)
        initialise(self, *args, **kwargs)

    monkeypatch.setattr(Simulator, "__init__", made)
