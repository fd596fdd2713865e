"""An effect that is turned moves a turned body as the effect moves the body: for the whole catalogue."""

from itertools import product

import numpy as np
import pytest
import torch

from model.gap.effects import ALL_EFFECTS, MassHeterogeneity
from model.gap.sight import Sight
from model.gap.world import World
from model.simulator.build import build_simulator
from model.simulator.system import State

ANGLE, COUNT = 0.3, 14
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])


def probes(effect):
    """All combinations of what shapes it, the rest at its start."""
    start = {name: quantity.start for name, quantity in effect.quantities.items()}
    return [start | dict(zip(effect.grid, each, strict=True)) for each in product(*effect.grid.values())]


@pytest.fixture(scope="module")
def places():
    """Random, longest along x, a little above the ground."""
    return np.random.default_rng(4).uniform(0, 1, (COUNT, 3)) * np.array([0.3, 0.15, 0.1]) + np.array(
        [0.2, 0, 0.003]
    )


@pytest.fixture(scope="module")
def velocities():
    return np.random.default_rng(5).normal(0, 0.5, (COUNT, 3))


def world_of(places: np.ndarray) -> World:
    """Points that are joined, held at one of them by a hand that moves sideways, over a ground."""
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    springs = np.argwhere(np.triu(apart < 0.12, 1))
    times = np.arange(4) / 30.0
    top = int(places[:, 2].argmax())
    controls = np.repeat(places[None, [top]], len(times), 0)
    simulator = build_simulator(
        points=places,
        mass=np.full(COUNT, 0.01),
        springs=springs,
        rest_length=0.95 * apart[springs[:, 0], springs[:, 1]],
        stiffness=20.0,
        controller_springs=np.array([[0, top]]),
        controller_rest_length=np.full(1, 1e-3),
        controller_stiffness=60.0,
        controller_points=controls[0] + np.array([0.0, 0.0, 1e-3]),
        dashpot_damping=0.02,
        friction=0.4,
        ground_height=0.0,
        dtype=torch.float64,
    )
    sight = Sight(torch.arange(COUNT)[:, None], torch.ones((COUNT, 1), dtype=torch.float64))
    return World(simulator, sight, times, torch.from_numpy(controls), ground_height=0.0)


def moved(kind, values, places, velocities):
    """Where the points are at last [m]."""
    world = world_of(places)
    effect = kind()
    tensors = {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}
    state = State(torch.from_numpy(places), torch.from_numpy(velocities))
    with torch.no_grad():
        return effect.apply(world, tensors).rollout(state, substeps=60).points[-1].numpy()


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_it_moves_what_is_turned_alike(kind, places, velocities):
    values = probes(kind())[-1]
    there = moved(kind, kind().turned(values, ANGLE), places @ TURN.T, velocities @ TURN.T)
    here = moved(kind, values, places, velocities)
    # a tilt about two axes is a tilt about one, but for the square of its size
    close = 1e-5 if kind.name == "gravity_tilt" else 1e-9
    np.testing.assert_allclose(there, here @ TURN.T, rtol=0, atol=close)


@pytest.mark.parametrize("name", ["wind", "gravity_tilt", "anisotropy"])
def test_what_has_a_direction_would_not_if_it_were_left(name, places, velocities):
    (kind,) = (kind for kind in ALL_EFFECTS if kind.name == name)
    values = probes(kind())[-1]
    there = moved(kind, values, places @ TURN.T, velocities @ TURN.T)
    here = moved(kind, values, places, velocities)
    assert np.abs(there - here @ TURN.T).max() > 3e-5


@pytest.mark.parametrize("angle", [0.6, 1.2, 2.5])
def test_a_load_is_looked_for_in_the_same_places_of_a_body_however_it_lies(angle, places):
    """Past an eighth of a turn sides of the box change their names, the places stay."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    effect = MassHeterogeneity()

    def fields(points):
        world = world_of(points)
        tried = [{name: torch.tensor(value) for name, value in one.items()} for one in probes(effect)]
        return np.stack([effect.strength(world, one).numpy() for one in tried])

    before, after = fields(places), fields(places @ turn.T)
    apart = np.abs(before[:, None] - after[None]).max(-1)
    np.testing.assert_allclose(apart.min(0), 0.0, atol=1e-6)
    np.testing.assert_allclose(apart.min(1), 0.0, atol=1e-6)
