import cv2
import numpy as np
import pytest

from model.reconstruction.gravity import field_of_view_from_lines, intrinsics_for, tilt_from_lines
from model.types import Camera

WIDTH, HEIGHT = 640, 400


def pose_of(pitch: float, roll: float) -> np.ndarray:
    a, r = np.deg2rad(pitch), np.deg2rad(roll)
    forward = np.array([0.0, np.cos(a), -np.sin(a)])
    right = np.array([1.0, 0.0, 0.0])
    down = np.cross(forward, right)
    turned = np.stack(
        [np.cos(r) * right - np.sin(r) * down, np.sin(r) * right + np.cos(r) * down, forward], 1
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned, -1.5 * forward
    return pose


def boxes(
    pitch: float, fov: float, roll: float = 0.0, turn: float = 0.35, upright: bool = True
) -> np.ndarray:
    """An image of the edges of some boxes on the ground, seen by a camera of known attitude."""
    intrinsics = intrinsics_for(np.deg2rad(fov), WIDTH, HEIGHT)
    camera = Camera(intrinsics, pose_of(pitch, roll), WIDTH, HEIGHT)
    image = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    about = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for x, y, w, d, h in [(-0.5, 0.2, 0.4, 0.3, 0.3), (0.3, 0.1, 0.3, 0.5, 0.4), (-0.2, -0.5, 0.5, 0.3, 0.2)]:
        flat = np.array([[x, y], [x + w, y], [x + w, y + d], [x, y + d]]) @ about.T
        low = np.c_[flat, np.zeros(4)]
        high = np.c_[flat, np.full(4, h)]
        edges = [(low[i], low[(i + 1) % 4]) for i in range(4)]
        if upright:
            edges += [(high[i], high[(i + 1) % 4]) for i in range(4)]
            edges += [(low[i], high[i]) for i in range(4)]
        for ends in edges:
            pixels, _ = camera.project(np.stack(ends))
            start, stop = (tuple(int(v) for v in np.round(p)) for p in pixels)
            cv2.line(image, start, stop, (40, 40, 40), 2, cv2.LINE_AA)
    return image


NOTHING = np.zeros((HEIGHT, WIDTH), bool)


@pytest.mark.parametrize(("pitch", "roll"), [(35.0, 0.0), (50.0, -4.0), (62.0, 3.0)])
def test_pitch_and_roll_come_from_the_edges_of_boxes(pitch, roll):
    image = boxes(pitch, 60.0, roll)
    tilt = tilt_from_lines(image, NOTHING, intrinsics_for(np.deg2rad(60), WIDTH, HEIGHT), np.deg2rad(50))
    assert tilt.reliable
    assert np.rad2deg(tilt.pitch) == pytest.approx(pitch, abs=2.0)
    assert np.rad2deg(tilt.roll) == pytest.approx(roll, abs=2.0)


def test_up_points_against_gravity_in_camera_coordinates():
    image = boxes(50.0, 60.0, 4.0)
    tilt = tilt_from_lines(image, NOTHING, intrinsics_for(np.deg2rad(60), WIDTH, HEIGHT), np.deg2rad(50))
    truth = pose_of(50.0, 4.0)[:3, :3].T @ [0, 0, 1]
    assert np.degrees(np.arccos(tilt.up @ truth)) < 2.5


@pytest.mark.parametrize("fov", [60.0, 85.0])
def test_level_and_upright_edges_together_fix_the_field_of_view(fov):
    found = field_of_view_from_lines(boxes(45.0, fov), NOTHING, np.deg2rad(50))
    assert found is not None
    assert np.rad2deg(found) == pytest.approx(fov, abs=4.0)


def test_squares_seen_straight_on_leave_the_field_of_view_open():
    # One vanishing point is at infinity and none is upright: a longer lens looking less far down fits too.
    image = boxes(45.0, 70.0, turn=0.0, upright=False)
    assert field_of_view_from_lines(image, NOTHING, np.deg2rad(50)) is None


@pytest.mark.parametrize("kind", ["blank", "noise", "one line"])
def test_without_evidence_the_default_is_returned_and_said_so(kind):
    image = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    if kind == "noise":
        image = np.random.default_rng(0).integers(0, 255, image.shape, np.uint8)
    if kind == "one line":
        cv2.line(image, (50, 200), (600, 210), (0, 0, 0), 2)
    tilt = tilt_from_lines(image, NOTHING, intrinsics_for(np.deg2rad(60), WIDTH, HEIGHT), np.deg2rad(33))
    assert not tilt.reliable
    assert np.rad2deg(tilt.pitch) == pytest.approx(33.0)
    assert tilt.roll == 0.0
    assert tilt.evidence


def test_lines_of_ignored_pixels_do_not_count():
    image = boxes(50.0, 60.0)
    everything = np.ones((HEIGHT, WIDTH), bool)
    tilt = tilt_from_lines(image, everything, intrinsics_for(np.deg2rad(60), WIDTH, HEIGHT), np.deg2rad(20))
    assert not tilt.reliable
