"""A cloth or a rope keeps large folds: a little stiffness, at ease as it is first seen."""

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.slight_bending import RUBBER, SLIGHT, slight_bending, stiffest_share
from model.simulator.dynamics import Dynamics
from model.simulator.system import State, System
from model.types import Observation

WEIGHT = 2.0


def bent(term, places, first=None):
    """Energy [J] and forces [N] of the term where its points are there, and were elsewhere at first."""
    nothing = torch.zeros((0, 2), dtype=torch.long)
    points = torch.from_numpy(places)
    system = System(points=points, mass=1.0, springs=nothing, rest_length=torch.zeros(0))
    dynamics = Dynamics(system, [term], [])
    before = points if first is None else torch.from_numpy(first)
    there, motion = (dynamics.motion(State(each, torch.zeros_like(each)), None) for each in (before, points))
    values = dynamics.forces[0][1]
    known = {**values, **term.rest_memory(there, values)}
    return float(term.energy(motion, known)), term.force(motion, known)


def test_it_is_at_ease_as_first_seen(hung):
    body = body_of(hung)
    energy, force = bent(slight_bending(body, WEIGHT), body.points)
    assert energy == pytest.approx(0.0, abs=1e-12)
    assert float(force.abs().max()) < 1e-5 * WEIGHT


def test_a_rope_that_was_curved_at_first_resists_being_straightened():
    angle = np.linspace(0.0, 1.0, 15)
    arc = 0.3 * np.stack([np.sin(angle), 1 - np.cos(angle), 0 * angle], -1)
    points = np.repeat(arc[None].astype(np.float32), 4, 0)
    body = body_of(Observation(np.arange(4) / 30.0, points, np.zeros((4, 0, 3), np.float32)))
    assert body.shape == "rope"
    term = slight_bending(body, WEIGHT)
    steps = np.linalg.norm(np.diff(body.points, axis=0), axis=1)
    straight = np.zeros_like(body.points)
    straight[1:, 0] = steps.cumsum()
    energy, force = bent(term, straight, body.points)
    # B κ² / s of every row, κ the angle between two pieces and s both of them together
    way = np.diff(body.points, axis=0) / steps[:, None]
    turn = np.arccos(np.clip((way[1:] * way[:-1]).sum(1), -1, 1))
    length = 2 * np.linalg.norm(body.points - body.points.mean(0), axis=1).max()
    stiffness = SLIGHT["rope"] * WEIGHT * length**2
    direct = (stiffness * (2 * np.tan(turn / 2)) ** 2 / (steps[1:] + steps[:-1])).sum()
    assert energy == pytest.approx(direct, rel=1e-3)
    # so little that its weight bends it as if it were not there
    assert float(force.abs().max()) < 0.01 * WEIGHT


def test_it_grows_with_the_weight(hung):
    body = body_of(hung)
    one, two = (slight_bending(body, weight).value("bending_stiffness") for weight in (1.0, 2.0))
    torch.testing.assert_close(two, 2 * one)


def test_a_solid_and_a_body_without_rows_have_none(block, hung):
    places = block.simulator.system.points.numpy()
    points = np.repeat(places[None].astype(np.float32), 4, 0)
    solid = body_of(Observation(np.arange(4) / 30.0, points, np.zeros((4, 0, 3), np.float32)), "solid")
    assert slight_bending(solid, WEIGHT) is None
    three = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.0, 0.1, 0]], np.float32)
    corner = Observation(np.arange(4) / 30.0, np.repeat(three[None], 4, 0), np.zeros((4, 0, 3), np.float32))
    apart = body_of(corner, "sheet")
    assert slight_bending(apart, WEIGHT) is None


@pytest.mark.parametrize("radius", [0.006, 0.012])
def test_a_soft_rope_bends_under_its_own_weight_over_a_length_that_it_is_thick(radius, thick_rope):
    """A cantilever of length l droops by w l⁴ / 8 B: an eighth of that, where it is as long as thick."""
    seen, middle = thick_rope(2, radius=radius)
    body = body_of(seen, "rope")
    stiffness = float(slight_bending(body, WEIGHT).value("bending_stiffness")[0])
    length = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    thick = 2 * radius
    droop = WEIGHT / length * thick**4 / (8 * stiffness)
    # how long and how thick it is is told from noisy places; bent, it is shorter across
    assert droop == pytest.approx(thick / 8, rel=0.4)


def test_it_may_remember_a_part_of_its_first_shape(thick_rope):
    body = body_of(thick_rope(2)[0], "rope")
    half, whole = (slight_bending(body, WEIGHT, memory=memory).value("rest_turn") for memory in (0.5, 1.0))
    assert float(whole.abs().max()) > 0.01
    torch.testing.assert_close(half, 0.5 * whole)


@pytest.mark.parametrize("gravity", [9.81, 1.62])
def test_no_usual_rope_resists_bending_more_than_a_full_one_of_soft_rubber(gravity, thick_rope):
    """B = E π d⁴ / 64, whose weight per length is ρ g π d² / 4."""
    seen, middle = thick_rope(2, radius=0.01)
    body = body_of(seen, "rope")
    length = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    density, thick = 1100.0, 0.02
    weight = density * gravity * np.pi * thick**2 / 4 * length
    most = slight_bending(body, weight, stiffest_share(body, gravity)).value("bending_stiffness")
    # how long and how thick it is is told from noisy places
    assert float(most.max()) == pytest.approx(RUBBER * density * np.pi * thick**4 / 64, rel=0.4)
