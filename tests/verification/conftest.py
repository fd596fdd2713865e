"""Small systems whose motion is known in closed form, in float64."""

import pytest
import torch

from model.simulator.simulator import Simulator
from model.simulator.system import State, System


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
