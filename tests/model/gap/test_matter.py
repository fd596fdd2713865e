from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.matter import CALM, LOOSEST, MASS, Matter


@pytest.fixture
def held(chain):
    """A straight rope whose end is held and shaken: what is seen of it, and its body."""
    seen = chain(1)
    return seen, body_of(seen)


def test_of_a_guessed_body_only_the_shape_is_known(held):
    seen, body = held
    matter = Matter.guessed(body, seen)
    assert not matter.given
    assert matter.mass.sum() == pytest.approx(MASS)
    assert matter.bending_decay == CALM["rope"]
    assert matter.slackness == 0.0
    ends = body.points[body.springs]
    np.testing.assert_allclose(matter.length, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))


def test_a_piece_twice_as_long_is_half_as_stiff(held):
    seen, body = held
    matter = Matter.guessed(body, seen)
    np.testing.assert_allclose(matter.pattern * matter.length, body.spacing)


def test_a_body_without_rows_has_no_zigzags_to_calm(held):
    seen, body = held
    apart = replace(body, springs=body.springs[::2])
    assert Matter.guessed(apart, seen).bending_decay == 0.0


def test_a_hand_holds_its_nearest_point_fully_and_others_by_their_distance(held):
    seen, body = held
    matter = Matter.guessed(replace(body, grip=np.array([[0, 0], [0, 1], [0, 39]])), seen)
    away = np.linalg.norm(body.points[[0, 1, 39]] - seen.controllers[0, 0], axis=1)
    reach = float(away[1])
    firm = matter.fading(torch.tensor(reach)).numpy()
    np.testing.assert_allclose(firm[:2], np.exp(-0.5 * (away[:2] ** 2 - away[0] ** 2) / reach**2), rtol=1e-5)
    assert firm[0] == 1.0
    assert firm[2] == pytest.approx(LOOSEST)


def test_a_known_hand_does_not_fade(held):
    seen, body = held
    known = replace(Matter.guessed(body, seen), hold=None)
    assert bool((known.fading(torch.tensor(0.01)) == 1.0).all())
