"""What a hand hides is filled: on the sheet, within the solid, and nowhere else."""

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.hidden import hidden_points, hiding
from model.types import Observation

SPACING = 0.03
T = np.arange(40) / 30.0


@pytest.fixture
def sheet():
    """A flat sheet at height 0.1 m, with a hole of 4.5 cm around the middle of one side."""
    u, v = np.meshgrid(np.arange(0, 0.31, SPACING), np.arange(0, 0.25, SPACING), indexing="ij")
    points = np.stack([u, v, 0 * u + 0.1], -1).reshape(-1, 3)
    return points[np.linalg.norm(points - [0.0, 0.12, 0.1], axis=1) > 0.045]


def test_a_hole_under_a_hand_is_filled_with_points_of_the_sheet(sheet):
    hand = np.array([[0.012, 0.125, 0.08], [0.005, 0.11, 0.11]])
    new = hidden_points(sheet, hand, "sheet", SPACING)
    assert len(new)
    np.testing.assert_allclose(new[:, 2], 0.1, atol=1e-6)
    assert np.linalg.norm(new[:, :2] - [0.0, 0.12], axis=1).max() < 0.02


def test_points_that_are_seen_are_not_filled_again(sheet):
    assert len(hidden_points(sheet, sheet[:4] + np.array([0, 0, 0.01]), "sheet", SPACING)) == 0


def recording(sheet, hand, follows):
    """A sheet that goes up and aside, or lies, and a hand that does so [C, 3]."""
    path = np.stack([0.2 * np.sin(3 * T), 0 * T, 0.2 * T], -1)[:, None]
    return Observation(T, (sheet + follows * path).astype(np.float32), (hand + path).astype(np.float32))


@pytest.mark.parametrize("follows", [True, False])
def test_a_hand_beyond_reach_hides_something_if_the_object_follows_it(sheet, follows):
    hand = np.array([[-0.1, 0.12, 0.1], [-0.5, 0.12, 0.1], [0.3, 0.24, 0.11]])
    seen = recording(sheet, hand, follows)
    np.testing.assert_array_equal(hiding(sheet, sheet, seen, SPACING), [follows, False, True])
    body = body_of(seen, "sheet")
    assert (0 in body.grip[:, 0]) == follows


def test_what_is_between_a_hand_and_the_rest_is_filled(sheet):
    hand = np.array([[-0.1, 0.12, 0.1]])
    new = hidden_points(sheet, hand, "sheet", SPACING)
    all_points = np.concatenate([sheet, new])
    way = hand[0] + np.linspace(0, 1, 20)[:, None] * np.array([0.1, 0.0, 0.0])
    gaps = np.linalg.norm(way[:, None] - all_points[None], axis=-1).min(1)
    assert gaps.max() < SPACING
    np.testing.assert_allclose(new[:, 2], 0.1, atol=1e-6)


def test_without_hands_nothing_is_hidden(sheet):
    assert len(hidden_points(sheet, np.zeros((0, 3)), "sheet", SPACING)) == 0
    assert len(hiding(sheet, sheet, recording(sheet, np.zeros((0, 3)), True), SPACING)) == 0


def test_what_a_hand_holds_of_a_solid_is_not_outside_of_it():
    grid = np.stack(np.meshgrid(*3 * [np.arange(5)], indexing="ij"), -1).reshape(-1, 3) * SPACING
    hole = np.linalg.norm(grid - [0.12, 0.06, 0.06], axis=1) < 0.035
    hand = np.array([[0.15, 0.06, 0.06], [0.1, 0.06, 0.06]])
    new = hidden_points(grid[~hole], hand, "solid", SPACING)
    assert len(new)
    assert (new.max(0) <= 0.12 + 1e-9).all()
