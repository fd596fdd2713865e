"""Rows that keep a bend, against closed forms: what they bear, what is left, and how it turns with them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from model.gap.effects.plastic_bending import PlasticBending
from model.gap.effects.plasticity import Plasticity
from model.gap.sight import Sight
from model.gap.world import World
from model.simulator.build import build_simulator

STIFFNESS, SPAN, YIELD = 2e-3, 0.04, 0.1
NAMES = tuple(PlasticBending.memory)


def row(angle):
    """Two pieces of half the span, the second turned by an angle [rad] about z."""
    piece = 0.5 * SPAN
    return np.array(
        [[-piece, 0.0, 0.0], [0.0, 0.0, 0.0], [piece * np.cos(angle), piece * np.sin(angle), 0.0]]
    )


def vectors(places):
    return tuple(tuple(torch.tensor(x, dtype=torch.float64) for x in place) for place in places)


class Hinge:
    """One of them, led through poses."""

    def __init__(self, places, flow_rate=1e3):
        self.rate = torch.tensor(flow_rate, dtype=torch.float64)
        self.memory = dict(zip(NAMES, PlasticBending.settled(vectors(places)), strict=True))

    def lead(self, places, dt=0.01):
        """Look once; then the energy [J] and the force on each point [N]."""
        told = PlasticBending.after(
            vectors(places), torch.tensor(YIELD), self.rate, **self.memory, dt=torch.tensor(dt)
        )
        self.memory = dict(zip(NAMES, told, strict=True))
        at = torch.tensor(places, requires_grad=True)
        known = tuple(tuple(place.unbind()) for place in at.unbind())
        energy = PlasticBending.potential(known, STIFFNESS, SPAN, **self.memory)
        return energy.item(), -torch.autograd.grad(energy, at)[0].numpy()


def turn(angle):
    return 2.0 * np.tan(0.5 * angle)


def test_beyond_its_yield_it_bears_no_more():
    hinge = Hinge(row(0.0))
    for angle in np.linspace(0.0, 0.8, 81):
        energy, _ = hinge.lead(row(angle))
        borne = min(turn(angle), YIELD)
        assert energy == pytest.approx(STIFFNESS * borne**2 / SPAN, rel=1e-3, abs=1e-9)


def test_let_go_it_is_bent_by_what_has_flowed():
    """It pulls at nothing where its turn is the largest one less the yield, and bears the yield beyond."""
    hinge, most = Hinge(row(0.0)), 0.8
    for angle in np.linspace(0.0, most, 81):
        hinge.lead(row(angle))
    left = 2.0 * np.arctan(0.5 * (turn(most) - YIELD))
    energy, force = hinge.lead(row(left))
    assert energy == pytest.approx(0.0, abs=1e-9)
    assert np.abs(force).max() < 1e-4
    for angle in np.linspace(left, -0.3, 81):
        energy, _ = hinge.lead(row(angle))
    assert energy == pytest.approx(STIFFNESS * YIELD**2 / SPAN, rel=1e-3)


def test_slow_flow_creeps():
    hinge, rate, dt = Hinge(row(0.0), flow_rate=2.0), 2.0, 0.01
    for step in range(1, 101):
        energy, _ = hinge.lead(row(0.6), dt)
        over = (energy * SPAN / STIFFNESS) ** 0.5 - YIELD
        assert over == pytest.approx((turn(0.6) - YIELD) * np.exp(-rate * dt * step), rel=1e-6)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.3, -0.2, 0.9)])
def test_a_bend_turns_with_its_row(axis):
    """About whatever is across its chord it is the same afterwards."""
    stretched = row(0.56)
    chord = stretched[2] - stretched[0]
    across = np.array(axis) - chord * (axis @ chord) / (chord @ chord)
    across /= np.linalg.norm(across)
    hinge = Hinge(row(0.5))
    before, force = hinge.lead(stretched)
    for angle in np.linspace(0.0, 2.0, 2001):
        turned = Rotation.from_rotvec(angle * across)
        energy, now = hinge.lead(turned.apply(stretched))
    assert energy == pytest.approx(before, rel=0.02)
    np.testing.assert_allclose(turned.inv().apply(now), force, atol=0.02 * np.abs(force).max())


def test_it_pulls_and_turns_nothing_as_a_whole():
    hinge = Hinge(row(0.5))
    bent = Rotation.from_rotvec([0.2, 0.0, 0.0]).apply(row(0.7))
    _, force = hinge.lead(bent)
    np.testing.assert_allclose(force.sum(0), 0.0, atol=1e-12)
    torque, chord = np.cross(bent, force).sum(0), bent[2] - bent[0]
    across = torque - chord * (torque @ chord) / (chord @ chord)
    assert np.linalg.norm(across) < 1e-9


@pytest.fixture
def rope():
    """Nine points in a bow, held at one end, which is swung; float64."""
    count = 9
    angle = np.linspace(0.0, 0.8, count)
    points = 0.25 * np.stack([np.sin(angle), 0 * angle, 2.0 - np.cos(angle)], -1)
    springs = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
    times = np.arange(10) / 30.0
    swing = 0.05 * np.stack([np.sin(15 * times), np.sin(10 * times), 0 * times], -1)
    simulator = build_simulator(
        points=points,
        mass=np.full(count, 0.01),
        springs=springs,
        rest_length=np.linalg.norm(np.diff(points, axis=0), axis=1),
        stiffness=200.0,
        controller_springs=np.array([[0, 0]]),
        controller_rest_length=np.zeros(1),
        controller_stiffness=300.0,
        controller_points=points[:1],
        dashpot_damping=0.1,
        dtype=torch.float64,
    )
    sight = Sight(torch.arange(count)[:, None], torch.ones((count, 1), dtype=torch.float64))
    return World(simulator, sight, times, torch.from_numpy(points[:1][None] + swing[:, None]))


VALUES = {
    "flow_rate": 10.0,
    "yield_strain": 0.01,
    "hardening": 0.2,
    "bending_stiffness": 2e-3,
    "yield_curvature": 0.3,
}


def rolled(world, values, backend="auto"):
    made = Plasticity().apply(world, values)
    return replace(made, simulator=made.simulator.with_backend(backend)).rollout(last=3, substeps=30).points


def numbers(**more):
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in {**VALUES, **more}.items()}


def test_a_rope_that_keeps_its_bends_moves_as_the_oracle_says_with_slopes(rope):
    values = {name: value.requires_grad_() for name, value in numbers().items()}
    found = {}
    for backend in ("torch", "kernel"):
        points = rolled(rope, values, backend)
        weights = torch.linspace(1.0, 2.0, points.numel(), dtype=points.dtype).reshape(points.shape)
        found[backend] = points, torch.autograd.grad((weights * points).square().sum(), list(values.values()))
    torch.testing.assert_close(found["kernel"][0], found["torch"][0], rtol=0, atol=1e-11)
    torch.testing.assert_close(found["kernel"][1], found["torch"][1], rtol=1e-7, atol=1e-12)
    names = dict(zip(values, found["torch"][1], strict=True))
    assert all(float(names[name].abs()) > 0.0 for name in ("bending_stiffness", "yield_curvature"))


def test_many_ropes_at_once_move_as_each_does(rope):
    stiff = torch.tensor([[1e-4], [1e-3], [4e-3]], dtype=torch.float64)
    with torch.no_grad():
        together = rolled(rope, numbers() | {"bending_stiffness": stiff})
        for i, each in enumerate(stiff):
            alone = rolled(rope, numbers(bending_stiffness=float(each)))
            torch.testing.assert_close(together[:, i], alone, rtol=0, atol=1e-10)


def test_a_rope_that_yields_early_is_left_bent(rope):
    with torch.no_grad():
        stiff, soft = (rolled(rope, numbers(yield_curvature=limit)) for limit in (50.0, 0.1))
    assert float((stiff - soft).norm(dim=-1).max()) > 1e-4


def test_what_is_thick_bends_by_its_springs(block):
    assert "plastic_bending" not in Plasticity().apply(block, numbers()).simulator.forces
