"""The way a body lies turns with it, whatever else is done to it."""

import numpy as np
import pytest

from model.gap.heading import from_axes, heading, turned_level, wrapped


@pytest.fixture
def body():
    """Longest along x, and reaching out farther there on one side."""
    rng = np.random.default_rng(2)
    return rng.exponential(1.0, (40, 3)) * np.array([0.3, 0.1, 0.5]) + np.array([2.0, -1.0, 0.4])


def turned(points, angle):
    return np.concatenate([turned_level(points[:, :2], angle), points[:, 2:]], axis=1)


def test_it_is_along_the_longest_side_to_where_it_reaches_out(body):
    assert abs(heading(body)) < 0.2
    assert abs(heading(body * np.array([-1.0, 1.0, 1.0]))) > np.pi - 0.2
    assert heading(body[:, [1, 0, 2]]) == pytest.approx(np.pi / 2, abs=0.2)


@pytest.mark.parametrize("angle", [0.3, 0.9, 2.0, -3.0])
def test_it_turns_with_the_body(body, angle):
    assert wrapped(heading(turned(body, angle)) - heading(body) - angle) == pytest.approx(0.0, abs=1e-9)


def test_place_height_and_order_do_not_matter(body):
    other = np.random.default_rng(0).permutation(body + np.array([5.0, 3.0, -1.0]))
    other[:, 2] *= 4.0
    assert heading(other) == pytest.approx(heading(body), abs=1e-9)


def test_angles_are_wrapped():
    assert wrapped(3.5 * np.pi) == pytest.approx(-0.5 * np.pi)
    assert from_axes(0.3) == pytest.approx(0.3)
    assert from_axes(np.pi / 2 + 0.1) == pytest.approx(0.1)
    assert from_axes(-np.pi + 0.2) == pytest.approx(0.2)


def test_a_quarter_turn_is_from_x_to_y():
    np.testing.assert_allclose(
        turned_level(np.array([[1.0, 0.0], [0.0, 2.0]]), np.pi / 2), [[0, 1], [-2, 0]], atol=1e-12
    )
