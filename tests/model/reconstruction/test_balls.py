import cv2
import numpy as np
import pytest

from model.reconstruction.balls import (
    Balls,
    flatness_of,
    floating_balls,
    inflate,
    plane_points,
    resting_balls,
)


def disc(radius, size=(200, 200)):
    y, x = np.mgrid[: size[0], : size[1]]
    return np.hypot(x - 100, y - 100) <= radius


def test_strands_and_discs_are_rounder_than_cushions():
    strand = cv2.line(np.zeros((200, 200), np.uint8), (10, 100), (190, 100), 1, 12) > 0
    square = cv2.rectangle(np.zeros((200, 200), np.uint8), (50, 50), (150, 150), 1, -1) > 0
    assert flatness_of(strand) == pytest.approx(1.0)
    assert flatness_of(disc(60)) > 0.8
    assert flatness_of(square) < 0.5


def test_resting_balls_find_the_ball_that_was_seen(scene_of):
    scene = scene_of([((0, 0, 0.06), (0.06, 0.06, 0.06))])
    balls = resting_balls(scene.mask, scene.camera, 1.0, 0.0)
    np.testing.assert_allclose(balls.centers[0], [0, 0, 0.06], atol=0.006)  # pixels of 3.5 mm
    assert balls.radii[0] == pytest.approx(0.06, rel=0.06)
    assert balls.extent == pytest.approx(0.12, rel=0.06)


def test_floating_balls_lie_at_their_depth(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    balls = floating_balls(scene.mask, scene.camera, 0.5, 0.6)
    np.testing.assert_allclose(scene.camera.to_camera(balls.centers)[:, 2], 0.6)
    np.testing.assert_allclose(balls.axis, -scene.camera.forward)


def test_inflated_volume_of_one_flattened_ball_is_that_of_the_formula():
    balls = Balls(np.array([[0.1, 0.2, 0.03]]), np.array([0.05]), np.array([0.0, 0.0, 1.0]), 0.6)
    volume = inflate(balls, np.eye(3), 0.002)
    assert volume.total == pytest.approx(4 / 3 * np.pi * 0.05**3 * 0.6, rel=0.05)
    inside = volume.points[volume.distance > 0]
    np.testing.assert_allclose(np.ptp(inside, axis=0), [0.1, 0.1, 0.06], atol=0.005)


def test_rays_meet_the_plane_and_the_horizon_is_capped(scene_of):
    camera = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))], pitch=20.0).camera
    pixels = np.array([[99.5, 74.5], [99.5, 0.0]])
    points = plane_points(camera, pixels, np.array([0.0, 0.0, 1.0]), 0.0)
    np.testing.assert_allclose(points[0], 0.0, atol=1e-9)
    assert np.isfinite(points).all()
