from dataclasses import replace

import numpy as np
import pytest

from model.playground.grip import LAG, PATCH, SAG, grip_on, pick


def test_the_point_before_the_others_is_meant():
    cloud = np.array([[0.0, 0, 0], [0, 0, 1], [0.02, 0, 2], [3, 0, 5]])
    down = np.array([0.0, 0, -1])
    assert pick(cloud, np.array([0.0, 0, 9]), down, spacing=0.05) == 2
    assert pick(cloud, np.array([0.0, 0, -9]), -down, spacing=0.05) == 0
    assert pick(cloud, np.array([3.0, 0, 9]), down, spacing=0.05) == 3


def test_a_line_that_misses_or_looks_away_means_nothing():
    cloud = np.zeros((1, 3))
    assert pick(cloud, np.array([0.3, 0, 1.0]), np.array([0.0, 0, -1]), spacing=0.1) is None
    assert pick(cloud, np.array([0.0, 0, 1.0]), np.array([0.0, 0, 1]), spacing=0.1) is None


def test_a_hold_is_spread_and_carries_the_object(twin):
    grip = grip_on(1, 13, twin, twin.topology.points)
    assert 1 < len(grip.points) <= PATCH
    assert 13 in grip.points
    np.testing.assert_allclose(grip.places, twin.topology.points[grip.points], atol=1e-6)
    assert grip.stiffness.sum() >= 9.81 * twin.topology.mass.sum() / SAG * 0.999


def test_so_does_one_on_points_that_nothing_joins(twin):
    none = np.zeros((0, 2), np.int32), np.zeros(0, np.float32)
    topology = replace(twin.topology, springs=none[0], rest_length=none[1])
    loose = replace(twin, topology=topology, parameters=replace(twin.parameters, stiffness=none[1]))
    grip = grip_on(1, 13, loose, topology.points)
    assert grip.stiffness.sum() == pytest.approx(9.81 * topology.mass.sum() / SAG)


def test_a_free_one_rides_along_and_a_held_one_follows_the_pointer(twin):
    points = twin.topology.points
    grip = grip_on(1, 5, twin, points)
    moved = points + np.float32([0.1, 0, 0])
    np.testing.assert_allclose(grip.later(0.1, moved).place, moved[5], atol=1e-6)
    held = replace(grip, dragged=True, target=grip.place + np.array([0.0, 0.0, 1.0]))
    later = held.later(LAG, moved)
    assert later.place[2] - grip.place[2] == pytest.approx(1 - np.exp(-1))
    assert later.place[0] == grip.place[0]


def test_taking_hold_keeps_the_points_where_they_are_now(twin):
    squeezed = twin.topology.points * np.float32([1, 1, 0.5])
    grip = grip_on(1, 5, twin, twin.topology.points).taking_hold(squeezed)
    np.testing.assert_allclose(grip.places, squeezed[grip.points], atol=1e-6)


def test_grips_can_be_told_apart(twin):
    """A scene asks whether there is anything new to show: two holds are compared, arrays and all."""
    grip = grip_on(1, 5, twin, twin.topology.points)
    dragged = replace(grip, dragged=True, target=grip.place + 1.0)
    assert (grip,) == (grip,)
    assert (grip,) != (dragged,)
