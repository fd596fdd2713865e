import numpy as np
import pytest

from model.controllers.grip_depth import SLACK, Tethers, constant_depth, paired_scale, tethered_depth
from model.types import Calibration, Camera


def camera():
    """One metre above the ground, looking forward and down by 45°."""
    tilt = np.sqrt(0.5)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, -tilt, tilt], [0, -tilt, -tilt]])
    pose[:3, 3] = [0, -1, 1]
    intrinsics = np.array([[200.0, 0, 100], [0, 200.0, 80], [0, 0, 1]])
    return Camera(intrinsics, pose, 200, 160)


def world(ground):
    return Calibration(camera(), (0.0, 0.0, -9.81), ground, "", "", "")


START = np.array([0.0, 0.0, 0.02])


def seen_at(points):
    return camera().project(np.asarray(points, np.float64))[0]


def test_up_in_the_image_keeps_the_depth():
    pixels = seen_at([START])[0] - np.array([0.0, 1.0]) * np.linspace(0, 40, 5)[:, None]
    depth = constant_depth(pixels, START, world(0.0))
    np.testing.assert_allclose(depth, depth[0])
    assert (np.diff(camera().unproject(pixels, depth)[:, 2]) > 0).all()


def test_towards_the_camera_slides_at_the_height_it_rests_at():
    pixels = seen_at([START])[0] + np.array([0.5, 1.0]) * np.linspace(0, 40, 5)[:, None]
    height = camera().unproject(pixels, constant_depth(pixels, START, world(0.0)))[:, 2]
    np.testing.assert_allclose(height, START[2], atol=1e-9)
    sunk = camera().unproject(pixels, constant_depth(pixels, START, world(None)))[:, 2]
    assert sunk[-1] < -0.05


@pytest.mark.parametrize(("depth", "moved"), [(2.5, True), (0.3, True), (None, False)])
def test_a_tether_moves_the_grip_along_its_ray_no_more_than_needed(depth, moved):
    places = np.array([[0.2, 0.05 * index, 0.0] for index in range(6)])
    point = np.array([[0.0, 0.1, 0.25]])
    pixels, true = camera().project(point)
    reach = np.linalg.norm(places - point, axis=1)
    tethers = Tethers(places, reach, np.ones((1, 6), bool))
    found = tethered_depth(pixels, true if depth is None else np.array([depth]), tethers, camera())
    away = np.linalg.norm(camera().unproject(pixels, found) - places, axis=1)
    if moved:
        assert (away / reach).max() == pytest.approx(SLACK, abs=0.04)
    else:
        assert found == pytest.approx(true)


def test_places_that_do_not_rest_or_are_few_hold_nothing():
    places = np.zeros((6, 3))
    pixels, reach = np.array([[100.0, 80.0]]), np.full(6, 0.1)
    for resting in (np.zeros((1, 6), bool), np.eye(1, 6, dtype=bool)):
        found = tethered_depth(pixels, np.array([3.0]), Tethers(places, reach, resting), camera())
        assert found == pytest.approx(3.0)
    none = Tethers(np.zeros((0, 3)), np.zeros(0), np.zeros((1, 0), bool))
    assert tethered_depth(pixels, np.array([3.0]), none, camera()) == pytest.approx(3.0)


def test_two_grips_do_not_tear_the_object():
    first = np.array([[0.0, 0, 0], [0.0, 0, 0]])
    second = np.array([[0.1, 0, 0], [0.4, 0, 0]])
    np.testing.assert_allclose(paired_scale(first, second, 0.2), [1.0, SLACK * 0.5])
