"""Small systems whose motion is known in closed form, in float64."""

import importlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State, System


@pytest.fixture
def points():
    """A system of loose points at the given places [m]."""

    def build(places, mass=1.0):
        return System(
            points=torch.tensor(places, dtype=torch.float64),
            mass=mass,
            springs=torch.zeros((0, 2), dtype=torch.long),
            rest_length=torch.zeros(0),
        )

    return build


@pytest.fixture
def chain():
    """A straight chain of `count` points along x, `spacing` [m] apart, optionally held at both ends."""

    def build(count, spacing, mass, held=False):
        index = torch.arange(count)
        places = torch.zeros((count, 3), dtype=torch.float64)
        places[:, 0] = index * spacing
        grip = torch.tensor([[0, 0], [1, count - 1]]) if held else None
        return System(
            points=places,
            mass=mass,
            springs=torch.stack([index[:-1], index[1:]], dim=1),
            rest_length=spacing,
            controller_springs=grip,
            controller_points=places[[0, -1]] if held else None,
        )

    return build


@pytest.fixture
def blob():
    """Ten points in general position and all springs between them."""
    places = torch.rand((10, 3), dtype=torch.float64, generator=torch.Generator().manual_seed(4)) * 0.2
    springs = torch.triu_indices(10, 10, 1).T
    rest = (places[springs[:, 0]] - places[springs[:, 1]]).norm(dim=1)
    mass = torch.linspace(0.5, 1.5, 10, dtype=torch.float64)
    return System(points=places, mass=mass, springs=springs, rest_length=rest)


@pytest.fixture
def pair(blob):
    """Two bodies of five points each, side by side along x, 0.1 m and more apart."""
    places = blob.points + torch.tensor([[0.0, 0, 0]] * 5 + [[0.3, 0, 0]] * 5)
    springs = torch.cat([torch.triu_indices(5, 5, 1).T, torch.triu_indices(5, 5, 1).T + 5])
    rest = (places[springs[:, 0]] - places[springs[:, 1]]).norm(dim=1)
    return System(points=places, mass=blob.value("mass"), springs=springs, rest_length=rest)


@pytest.fixture
def meeting(pair):
    """They fly at each other at 6 m/s."""
    speeds = torch.tensor([[3.0, 0.5, 0]] * 5 + [[-3.0, 0, 0.2]] * 5, dtype=torch.float64)
    return State(pair.points, speeds)


@pytest.fixture(autouse=True, params=["torch", "auto"])
def backend(request, monkeypatch):
    """Simulators made in the test compute rollouts in plain torch, then as they do by default."""
    initialise = Simulator.__init__

    def made(self, *args, **kwargs):
        if len(args) < 5:
            kwargs.setdefault("backend", request.param)
        initialise(self, *args, **kwargs)

    monkeypatch.setattr(Simulator, "__init__", made)


@dataclass(frozen=True)
class Body:
    """What moves, how it starts and what the hands do."""

    system: System
    stiffness: torch.Tensor
    start: State
    controls: torch.Tensor | None

    def simulator(self, *more, contacts=()):
        """Springs and dashpots of the body and its grips, and `more`."""
        held = [ControllerSpring(90.0)] if self.system.controller_count else []
        return Simulator(self.system, [Spring(self.stiffness), *held, Dashpot(0.05), *more], contacts)

    def hands(self, frame, interval, share):
        """Where they are at this share of the way to a frame, by the contract, not by the code under test."""
        if self.controls is None:
            return None
        begin, end = self.controls[frame - 1], self.controls[frame]
        return Anchors((1 - share) * begin + share * end, (end - begin) / interval)

    def by(self, springs, frames, interval, substeps):
        """Where another simulator has the points in each frame [m]."""
        springs.set(self.start.positions.numpy(), self.start.velocities.numpy())
        places = [springs.positions]
        for frame in range(1, frames):
            for substep in range(substeps):
                springs.step(self.hands(frame, interval, (substep + 1) / substeps))
            places.append(springs.positions)
        return np.stack(places)


@pytest.fixture
def handled():
    """A body of points on a grid, each in another place, of another mass, joined to its neighbours."""

    def build(shape, frames=4, held=True, dtype=torch.float64):
        rng = np.random.default_rng(2)
        grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3)
        places = 0.05 * grid + rng.uniform(-0.005, 0.005, grid.shape)
        pairs = np.argwhere(np.triu(np.linalg.norm(places[:, None] - places, axis=-1) < 0.09, k=1))
        rest = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
        hands = places[[0, -1]] + [[-0.01, 0.0, 0.03], [0.01, 0.0, 0.03]]
        system = System(
            points=torch.tensor(places, dtype=dtype),
            mass=torch.from_numpy(rng.uniform(0.005, 0.015, len(places))),
            springs=torch.from_numpy(pairs),
            rest_length=torch.from_numpy(rest * rng.uniform(0.95, 1.05, len(rest))),
            controller_springs=torch.tensor([[0, 0], [1, len(places) - 1]]) if held else None,
            controller_rest_length=torch.tensor([0.03, 0.02]) if held else None,
            controller_points=torch.tensor(hands, dtype=dtype) if held else None,
        )
        motion = hands + np.cumsum(rng.normal(0, 0.01, (frames, 2, 3)), axis=0)
        start = State(system.points, torch.tensor(rng.normal(0, 0.3, places.shape), dtype=dtype))
        stiffness = torch.from_numpy(rng.uniform(30.0, 90.0, len(pairs)))
        return Body(system, stiffness, start, torch.tensor(motion, dtype=dtype) if held else None)

    return build


@pytest.fixture
def thrown(points, handled):
    """Loose points or a body, thrown at the ground z = 0 from its rest places."""

    def build(shape, velocity):
        if shape is None:
            system, stiffness = (
                points([[0.0, 0, 0.05], [1.0, 0, 0.07]], torch.tensor([0.1, 0.01])),
                torch.zeros(0),
            )
        else:
            body = handled(shape, held=False)
            system, stiffness = body.system, body.stiffness
        places = system.points + torch.tensor([0.0, 0, 0.03], dtype=torch.float64)
        speeds = torch.tensor(velocity, dtype=torch.float64).expand_as(places).clone()
        return Body(system, stiffness, State(places, speeds), None)

    return build


@pytest.fixture
def peer(monkeypatch):
    """Another simulator's springs, as the benchmark times them."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks/simulator")
    return importlib.import_module
