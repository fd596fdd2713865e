"""Nets of sheets: regular, on what is seen, the same however it is turned."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from model.gap.bodies.sheet import net


def flat(count, seed=0, size=(0.4, 0.3), noise=0.0):
    """So many points by lot on a rectangle that stands."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 1, (count, 2)) * size
    return np.stack([places[:, 0], noise * rng.normal(size=count), places[:, 1]], -1)


def bend(places, radius=0.1):
    """Over a half round beam."""
    angle = (places[:, 0] - 0.2) / radius
    return np.stack([radius * np.sin(angle), places[:, 2], radius * np.cos(angle)], -1)


@pytest.mark.parametrize("count", [80, 180, 1000])
def test_has_as_many_points_however_many_are_seen(count):
    points, spacing = net(flat(count), 1.0)
    assert 108 <= len(points) <= 120
    nearest = np.sort(cKDTree(points).query(points, k=7)[0], axis=1)
    np.testing.assert_allclose(nearest[:, 1], spacing, rtol=1e-5)
    inner = nearest[np.isclose(nearest[:, 6], spacing, rtol=1e-5)]
    assert len(inner) > 60  # in the midst of six
    assert net(flat(count), 0.7)[1] == pytest.approx(0.7 * spacing)


def test_covers_what_is_seen_and_hardly_more():
    places = flat(300)
    points, spacing = net(places, 1.0)
    assert cKDTree(points).query(places)[0].max() < 1.0 * spacing
    assert cKDTree(places).query(points)[0].max() < 1.0 * spacing
    outside = np.maximum(points[:, [0, 2]] - [0.4, 0.3], -points[:, [0, 2]]).max()
    assert outside < 0.6 * spacing


def test_a_hole_stays_one():
    places = flat(400)
    middle = np.abs(places[:, [0, 2]] - [0.2, 0.15]).max(1) < 0.09
    points, spacing = net(places[~middle], 1.0)
    away = np.abs(points[:, [0, 2]] - [0.2, 0.15]).max(1)
    assert away.min() > 0.09 - spacing


def test_noise_is_evened_out():
    points, _ = net(flat(400, noise=0.003), 1.0)
    assert np.sqrt((points[:, 1] ** 2).mean()) < 0.0015


@pytest.mark.parametrize("bent", [False, True])
def test_is_the_same_turned_moved_and_in_another_order(bent):
    places = bend(flat(200)) if bent else flat(200)
    points, spacing = net(places, 1.0)
    turn = Rotation.from_rotvec([0.3, -0.8, 0.4])
    order = np.random.default_rng(1).permutation(len(places))
    moved = np.array([1.0, 2.0, 3.0])
    again, other = net(turn.apply(places[order]) + moved, 1.0)
    assert other == pytest.approx(spacing, rel=1e-5)
    assert len(again) == len(points)
    assert cKDTree(turn.apply(points) + moved).query(again)[0].max() < 1e-4


def test_lies_on_what_is_bent():
    points, spacing = net(bend(flat(300)), 1.0)
    away = np.hypot(points[:, 0], points[:, 2])
    assert np.sqrt(((away - 0.1) ** 2).mean()) < 0.004
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    np.testing.assert_allclose(nearest, spacing, rtol=0.11)


def test_few_markers_are_points_themselves():
    places = flat(30)
    points, _ = net(places, 1.0)
    assert set(map(tuple, points)) <= set(map(tuple, places))


def test_markers_in_the_same_places_are_few():
    places = np.repeat(flat(30), 3, axis=0)
    points, _ = net(places, 1.0)
    assert set(map(tuple, points)) <= set(map(tuple, places))


def test_so_are_those_of_what_lies_on_itself_or_in_a_row():
    """Of a sheet folded double nobody knows which layer a point is of; beside a row there is nothing."""
    double = flat(200)
    double = np.stack([np.abs(double[:, 0] - 0.2), 0.02 * (double[:, 0] > 0.2), double[:, 2]], -1)
    row = np.stack([np.linspace(0, 1, 60), np.zeros(60), np.zeros(60)], -1)
    for places in (double, row):
        points, _ = net(places, 1.0)
        assert set(map(tuple, points)) <= set(map(tuple, places))
    assert pdist(net(row, 1.0)[0]).min() > 0.0
