import numpy as np
import pytest

from model.controllers.grip_paths import grip_paths
from model.types import Calibration, Camera, Controllers


def look_down(pitch_degrees: float, ground: float | None = 0.0) -> Calibration:
    """A camera 1 m from the origin, looking at it, `pitch_degrees` below the horizon, along +y."""
    pitch = np.deg2rad(pitch_degrees)
    forward = np.array([0.0, np.cos(pitch), -np.sin(pitch)])
    right = np.array([1.0, 0.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = -forward
    intrinsics = np.array([[400.0, 0, 200], [0, 400.0, 150], [0, 0, 1]])
    camera = Camera(intrinsics, pose, 400, 300)
    return Calibration(camera, (0.0, 0.0, -9.81), ground, "test", "test", "test")


def parallel_lift(calibration: Calibration, height: float = 0.2) -> Controllers:
    """Two points of one hand that move up the image at constant depth."""
    up = -calibration.camera.world_from_camera[:3, 1]
    rest = np.array([[0.0, 0.0, 0.02], [0.01, 0.0, 0.02]])
    steps = np.linspace(0, height, 6)[:, None, None]
    return Controllers((rest + steps * up).astype(np.float32), np.array([0, 0]))


@pytest.mark.parametrize("pitch", [20, 50])
def test_all_paths_begin_at_rest_and_look_the_same(pitch):
    calibration = look_down(pitch)
    given = parallel_lift(calibration)
    paths = grip_paths(given, calibration)
    assert list(paths)[:3] == ["parallel", "upright", "between"]
    expected, _ = calibration.camera.project(given.motion.mean(axis=1))
    for path in paths.values():
        np.testing.assert_allclose(path.motion[0], given.motion[0], atol=1e-6)
        pixels, _ = calibration.camera.project(path.motion.mean(axis=1))
        np.testing.assert_allclose(pixels, expected, atol=0.05)


def test_upright_rises_straight_and_between_lies_halfway():
    calibration = look_down(50)
    given = parallel_lift(calibration)
    paths = grip_paths(given, calibration)
    np.testing.assert_allclose(paths["upright"].motion[..., 1], 0.0, atol=1e-6)
    assert paths["upright"].motion[-1, 0, 2] > given.motion[-1, 0, 2]
    middle = (paths["upright"].motion + given.motion) / 2
    np.testing.assert_allclose(paths["between"].motion, middle, atol=1e-6)


def test_sliding_keeps_its_height_and_needs_a_ground():
    calibration = look_down(60)
    given = parallel_lift(calibration, 0.05)
    np.testing.assert_allclose(grip_paths(given, calibration)["sliding"].motion[..., 2], 0.02, atol=1e-6)
    assert "sliding" not in grip_paths(given, look_down(60, ground=None))


def test_nothing_held_has_one_path():
    empty = Controllers(np.zeros((4, 0, 3), np.float32), np.zeros(0, int))
    assert list(grip_paths(empty, look_down(40))) == ["parallel"]
