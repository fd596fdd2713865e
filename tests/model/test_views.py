import numpy as np
import pytest

from model.types import Camera
from model.views import look_at, overview, scaled


def test_a_look_at_camera_sees_its_target_upright_in_the_middle():
    camera = look_at(np.array([1.0, -2.0, 1.5]), np.array([0.2, 0.1, 0.3]), 500.0, 640, 480)
    (x, y), depth = camera.project(np.array([0.2, 0.1, 0.3]))
    assert (x, y) == pytest.approx((319.5, 239.5))
    assert depth == pytest.approx(np.linalg.norm([0.8, -2.1, 1.2]))
    above, _ = camera.project(np.array([0.2, 0.1, 0.4]))
    assert above[1] < y
    assert above[0] == pytest.approx(x)
    assert np.linalg.det(camera.world_from_camera[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize("size", [(848, 480), (368, 480), (101, 333)])
def test_a_scaled_camera_sees_the_same_view(size):
    width, height = size
    intrinsics = np.array([[700.0, 0, 200], [0, 690.0, 150], [0, 0, 1]])
    camera = Camera(intrinsics, np.eye(4), width, height)
    small = scaled(camera, 320)
    assert max(small.width, small.height) <= 320
    assert small.width % 2 == small.height % 2 == 0
    points = np.random.default_rng(0).uniform([-0.2, -0.2, 1], [0.2, 0.2, 2], (50, 3))
    before, after = camera.project(points)[0], small.project(points)[0]
    # The same share of the image, corner to corner.
    np.testing.assert_allclose((after + 0.5) / [small.width, small.height], (before + 0.5) / [width, height])


def test_small_images_are_not_enlarged():
    camera = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), 64, 48)
    same = scaled(camera, 640)
    assert (same.width, same.height) == (64, 48)
    np.testing.assert_allclose(same.intrinsics, camera.intrinsics)


@pytest.mark.parametrize("size", [[0.3, 0.2, 0.1], [0.01, 0.02, 1.5], [0.0, 0.0, 0.0]])
def test_an_overview_sees_everything_from_above(size):
    points = (np.random.default_rng(0).uniform(-1, 1, (200, 3)) * size + [5, 5, 1]).astype(np.float32)
    camera = overview(points)
    pixels, depth = camera.project(points)
    assert (depth > 0.01).all()
    assert (pixels > 0).all()
    assert (pixels < [camera.width - 1, camera.height - 1]).all()
    assert camera.forward[2] < -0.2
