"""What a hand hides is filled: on the sheet, within the solid, and nowhere else."""

import numpy as np
import pytest

from model.gap.bodies.hidden import hidden_points

SPACING = 0.03


@pytest.fixture
def sheet():
    """A flat sheet at height 0.1 m, with a hole of 4.5 cm around the middle of one side."""
    u, v = np.meshgrid(np.arange(0, 0.31, SPACING), np.arange(0, 0.25, SPACING), indexing="ij")
    points = np.stack([u, v, 0 * u + 0.1], -1).reshape(-1, 3)
    return points[np.linalg.norm(points - [0.0, 0.12, 0.1], axis=1) > 0.045]


def test_a_hole_under_a_hand_is_filled_with_points_of_the_sheet(sheet):
    hand = np.array([[0.0, 0.12, 0.125], [0.012, 0.125, 0.08], [-0.005, 0.11, 0.11]])
    new = hidden_points(sheet, hand, "sheet", SPACING)
    assert len(new)
    np.testing.assert_allclose(new[:, 2], 0.1, atol=1e-6)
    assert np.linalg.norm(new[:, :2] - [0.0, 0.12], axis=1).max() < 0.02


def test_points_that_are_seen_are_not_filled_again(sheet):
    assert len(hidden_points(sheet, sheet[:4] + np.array([0, 0, 0.01]), "sheet", SPACING)) == 0


def test_a_hand_far_away_hides_nothing(sheet):
    assert len(hidden_points(sheet, np.array([[1.0, 0.0, 0.1]]), "sheet", SPACING)) == 0
    assert len(hidden_points(sheet, np.zeros((0, 3)), "sheet", SPACING)) == 0


def test_what_a_hand_holds_of_a_solid_is_not_outside_of_it():
    grid = np.stack(np.meshgrid(*3 * [np.arange(5)], indexing="ij"), -1).reshape(-1, 3) * SPACING
    hole = np.linalg.norm(grid - [0.12, 0.06, 0.06], axis=1) < 0.035
    hand = np.array([[0.15, 0.06, 0.06], [0.1, 0.06, 0.06]])
    new = hidden_points(grid[~hole], hand, "solid", SPACING)
    assert len(new)
    assert (new.max(0) <= 0.12 + 1e-9).all()
