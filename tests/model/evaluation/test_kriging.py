from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.kriging import NOISE, REACH, Kriging
from model.types import Camera


@pytest.fixture
def case(make_case):
    return make_case(frames=4)


def camera_below(case, distance):
    pose = np.eye(4)
    pose[:3, 3] = case.rest.mean(axis=0) - (0.0, 0.0, distance)
    return Camera(np.eye(3), pose, 10, 10)


def alike(case, a, b):
    reach = REACH * np.linalg.norm(np.ptp(case.rest.astype(float), axis=0))
    apart = np.linalg.norm(a.astype(float) - b.astype(float), axis=-1)
    return np.exp(-0.5 * (apart / reach) ** 2)


def only(case, *points):
    there = np.zeros(len(case.rest), bool)
    there[list(points)] = True
    return there


def test_one_point_that_is_seen_tells_of_those_near_it(case):
    error = np.full((len(case.rest), 3), np.nan)
    error[7] = 0.01, -0.02, 0.03
    mass, seen = Kriging(case)(error, only(case, 7), case.rest.astype(float))
    share = alike(case, case.topology.points, case.rest[7]) / (1.0 + NOISE)
    np.testing.assert_allclose(mass, share[:, None] * error[7], atol=1e-12)
    np.testing.assert_allclose(seen[7], error[7] / (1.0 + NOISE), atol=1e-12)
    far = np.linalg.norm(case.topology.points - case.rest[7], axis=1).argmax()
    assert np.abs(mass[far]).max() < 1e-3 * np.abs(mass).max()


def test_where_all_points_are_seen_the_sensors_noise_is_averaged(case):
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 1e-3, case.rest.shape)
    error = np.array([0.05, 0.0, 0.0]) + noise
    _, seen = Kriging(case)(error, only(case, *range(len(case.rest))), case.rest.astype(float))
    assert np.abs(seen.mean(axis=0) - (0.05, 0.0, 0.0)).max() < 2e-3
    assert (seen - (0.05, 0.0, 0.0)).std(axis=0)[1:].max() < 0.7e-3


def test_with_one_camera_an_error_is_known_across_its_lines_of_sight(case):
    rng = np.random.default_rng(1)
    error, there = rng.normal(0.0, 0.01, case.rest.shape), only(case, *range(0, 40, 3))
    places = case.rest.astype(float)
    flat = Kriging(replace(case, camera=camera_below(case, 1e6)))
    mass, seen = flat(error, there, places)
    full_mass, full_seen = Kriging(case)(error, there, places)
    np.testing.assert_allclose(mass[:, :2], full_mass[:, :2], atol=1e-6)
    np.testing.assert_allclose(seen[:, :2], full_seen[:, :2], atol=1e-6)
    assert np.abs(mass[:, 2]).max() < 1e-6


def test_directions_that_differ_tell_of_depth(case):
    """Near a camera, points to its left and right say together how far away the object is."""
    places, moved = case.rest.astype(float), np.tile([0.0, 0.0, 0.01], (len(case.rest), 1))
    near = Kriging(replace(case, camera=camera_below(case, 0.05)))
    mass, _ = near(moved, only(case, *range(len(case.rest))), places)
    assert mass[:, 2].mean() > 0.003
