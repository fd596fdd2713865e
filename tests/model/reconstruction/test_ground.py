import numpy as np
import pytest

from model.reconstruction.ground import back_projected, ground_from_depth

NO_HAND = np.zeros((150, 200), bool)


@pytest.mark.parametrize("pitch", [35.0, 60.0])
def test_the_table_is_found_in_noisy_depth(scene_of, pitch):
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))], pitch=pitch)
    depth = scene.depth + np.random.default_rng(0).normal(0, 0.002, scene.depth.shape)
    depth[np.random.default_rng(1).uniform(size=depth.shape) < 0.2] = 0.0
    plane = ground_from_depth(depth, scene.camera.intrinsics, scene.mask, NO_HAND)
    assert plane is not None
    truth = scene.camera.world_from_camera[:3, :3].T @ [0, 0, 1]
    assert np.degrees(np.arccos(plane.up @ truth)) < 0.7
    assert plane.camera_height == pytest.approx(scene.camera.position[2], rel=0.01)
    assert plane.inliers > 0.8


def test_scattered_depth_has_no_ground(scene_of):
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))])
    depth = np.random.default_rng(0).uniform(0.3, 2.0, scene.depth.shape)
    assert ground_from_depth(depth, scene.camera.intrinsics, scene.mask, NO_HAND) is None


def test_missing_depth_has_no_ground(scene_of):
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))])
    assert ground_from_depth(np.zeros((150, 200)), scene.camera.intrinsics, scene.mask, NO_HAND) is None


def test_a_ceiling_is_no_ground(scene_of):
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))])
    flipped = scene.depth[::-1].copy()
    assert ground_from_depth(flipped, scene.camera.intrinsics, scene.mask[::-1], NO_HAND) is None


def test_a_wall_behind_the_object_is_no_ground_and_a_table_from_above_is(scene_of):
    """Both face the camera; only on one of them something lies."""
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))], pitch=89.0)
    assert ground_from_depth(scene.depth, scene.camera.intrinsics, scene.mask, NO_HAND) is not None
    wall = np.where(scene.mask, scene.depth, scene.depth + 0.5)
    assert ground_from_depth(wall, scene.camera.intrinsics, scene.mask, NO_HAND) is None


def test_back_projection_undoes_projection(scene_of):
    scene = scene_of([((0, 0, 0.04), (0.05, 0.05, 0.04))])
    points = back_projected(scene.depth, scene.camera.intrinsics, scene.mask)
    rows, columns = np.nonzero(scene.mask)
    pixels, depth = scene.camera.project(scene.camera.to_world(points))
    np.testing.assert_allclose(pixels, np.stack([columns, rows], -1), atol=1e-9)
    np.testing.assert_allclose(depth, scene.depth[scene.mask])
