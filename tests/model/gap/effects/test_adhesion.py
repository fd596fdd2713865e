"""A sticky ground, against closed forms: what it pulls, what it costs to leave it, what it bears sideways."""

import numpy as np
import pytest
import torch
from scipy.integrate import quad

from model.gap.effects.adhesion import Adhesion
from model.simulator.build import build_simulator

PULL, REACH, HEIGHT = 3.0, 0.004, 0.1


def pull(above: float, at_contact: float) -> float:
    """Force [N] towards the ground on a point so high above it."""
    z = torch.tensor(HEIGHT + above, dtype=torch.float64, requires_grad=True)
    constants = (torch.tensor(value, dtype=torch.float64) for value in (PULL, REACH, at_contact, HEIGHT))
    energy = Adhesion.potential(((torch.zeros(()), torch.zeros(()), z),), *constants)
    (slope,) = torch.autograd.grad(energy, z)
    return float(slope)


@pytest.mark.parametrize("at_contact", [0.0, 0.4, 1.0])
def test_the_largest_pull_is_where_it_is_said(at_contact):
    most = (1.0 - at_contact) * REACH
    assert pull(most, at_contact) == pytest.approx(PULL)
    for above in np.linspace(0.0, 10 * REACH, 41):
        assert pull(above, at_contact) <= PULL * (1.0 + 1e-12)


@pytest.mark.parametrize("at_contact", [0.0, 0.4, 1.0])
def test_in_contact_it_pulls_as_hard_however_deep(at_contact):
    expected = PULL * at_contact * np.exp(1.0 - at_contact)
    for above in (-0.03, -1e-9, 1e-9):
        assert pull(above, at_contact) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("at_contact", [0.0, 0.4, 1.0])
def test_tearing_off_takes_the_work_of_adhesion(at_contact):
    work, _ = quad(pull, 0.0, 60 * REACH, args=(at_contact,))
    assert work == pytest.approx(PULL * REACH * (1.0 + at_contact) * np.exp(1.0 - at_contact), rel=1e-6)


@pytest.mark.parametrize(("at_contact", "slides"), [(1.0, False), (0.0, True)])
def test_what_is_pressed_down_in_contact_is_held_sideways(at_contact, slides):
    """A kilogram on ground of friction 0.5, pushed by 1.2 weights: it holds from 1.4 weights of pull on."""
    gravity = (1.2 * 9.81, 0.0, -9.81)
    simulator = build_simulator(
        points=np.zeros((1, 3)),
        mass=np.ones(1),
        springs=np.zeros((0, 2), np.int64),
        rest_length=np.zeros(0),
        stiffness=1.0,
        gravity=gravity,
        ground_height=0.0,
        friction=0.5,
    ).with_force(Adhesion(torch.zeros((1, 1), dtype=torch.int64), 1.6 * 9.81, REACH, at_contact, 0.0))
    with torch.no_grad():
        place = simulator.rollout(times=np.linspace(0.0, 0.5, 16), substeps=60).points[-1, 0]
    assert (float(place[0]) > 0.5) == slides
    if not slides:
        assert float(place[0]) == pytest.approx(0.0, abs=1e-6)
    assert float(place[2]) == pytest.approx(0.0, abs=1e-4)
