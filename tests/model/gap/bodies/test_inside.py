"""What is inside of a surface of which points alone are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies.inside import MOST, Inside

EGG = np.array([0.15, 0.1, 0.07])


def all_around(size, count=400):
    """Points everywhere in a box, the same each time."""
    return np.random.default_rng(0).uniform(-1.0, 1.0, (count, 3)) * size


def test_one_inside_half_on_the_surface_nothing_outside(egg):
    inside = Inside.of(egg)
    points = all_around(2.0 * EGG)
    far = np.linalg.norm(points / EGG, axis=1)
    assert inside(points[far < 0.7]).min() > 0.65
    assert inside(points[far > 1.3]).max() < 0.35
    np.testing.assert_allclose(inside(egg), 0.5, atol=0.1)


@pytest.mark.parametrize("seen_from", [-0.6, -0.3, 0.0, 0.3])
def test_one_side_may_be_unseen(egg, seen_from):
    """A camera sees what faces it."""
    inside = Inside.of(egg[egg[:, 2] > seen_from * EGG[2]])
    points = all_around(EGG)
    points = points[
        (np.linalg.norm(points / EGG, axis=1) < 0.8) & (points[:, 2] > (seen_from + 0.2) * EGG[2])
    ]
    assert inside(points).min() > 0.45


def test_the_hole_of_a_ring_is_outside(ring):
    inside = Inside.of(ring)
    points = all_around(np.array([0.13, 0.13, 0.03]), 2000)
    beside = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.1, points[:, 2])
    hole = np.hypot(points[:, 0], points[:, 1]) < 0.04
    assert inside(points[beside < 0.02]).min() > 0.6
    assert inside(points[hole]).max() < 0.3


def test_what_is_between_two_legs_is_outside(egg):
    apart = np.array([0.0, 0.3, 0.0])
    inside = Inside.of(np.concatenate([egg - apart / 2, egg + apart / 2]))
    assert inside(np.zeros((1, 3)))[0] < 0.3
    assert inside(np.stack([-apart / 2, apart / 2])).min() > 0.8


def test_turned_larger_and_in_another_order_it_is_the_same(egg):
    points, turn = all_around(1.5 * EGG), Rotation.from_rotvec([0.2, -0.4, 1.0])
    order = np.random.default_rng(1).permutation(len(egg))
    other = Inside.of(1000.0 * turn.apply(egg[order]))(1000.0 * turn.apply(points))
    np.testing.assert_allclose(other, Inside.of(egg)(points), atol=1e-9)


def test_many_points_are_thinned():
    i = np.arange(3 * MOST) + 0.5
    z, angle = 1 - i / (1.5 * MOST), np.pi * (1 + 5**0.5) * i
    ball = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], -1)
    inside = Inside.of(ball)
    assert len(inside.places) == MOST
    assert inside(np.zeros((1, 3)))[0] == pytest.approx(1.0, abs=0.15)
