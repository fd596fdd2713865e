import json
from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.reconstruction.cameras import calibrate
from model.reconstruction.silhouette import extent_of, silhouette_extent
from model.types import Masks


@pytest.fixture
def camera_file(tmp_path):
    """The file of a camera, with or without its pose."""

    def write(camera, pose=True, **more):
        entries = {"intrinsics": camera.intrinsics.tolist(), **more}
        if pose:
            entries["world_from_camera"] = camera.world_from_camera.tolist()
        path = tmp_path / "camera.json"
        path.write_text(json.dumps(entries))
        return path

    return write


def run(scene, file=None, size=None, shape_class="solid", depth=None, filled=False):
    return calibrate(
        scene.frames,
        scene.masks,
        camera_file=file,
        size_m=size,
        extent=lambda world: silhouette_extent(scene.masks, world, shape_class),
        depth=depth,
        shape_from_depth=filled,
    )


def test_a_pose_is_taken_as_it_is(teddy, camera_file):
    result = run(teddy, camera_file(teddy.camera, ground_height=0.0))
    np.testing.assert_allclose(result.camera.world_from_camera, teddy.camera.world_from_camera, atol=1e-12)
    np.testing.assert_allclose(result.camera.intrinsics, teddy.camera.intrinsics)
    assert result.ground_height == 0.0
    assert result.gravity == (0.0, 0.0, -9.81)
    assert "camera file" in result.camera_source
    assert "camera file" in result.scale_source
    assert result.warnings == ()


def test_the_plane_z_0_of_a_pose_is_the_ground_where_it_is_seen(teddy, camera_file):
    result = run(teddy, camera_file(teddy.camera))
    assert result.ground_height == 0.0
    assert "z = 0" in result.ground_source


def test_a_pose_that_looks_up_leaves_no_ground(teddy, camera_file):
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # level, at the height of the ground
    result = run(teddy, camera_file(replace(teddy.camera, world_from_camera=pose)))
    assert result.ground_height is None
    assert "position from the object" in result.camera_source
    np.testing.assert_allclose(result.camera.world_from_camera[:3, :3], pose[:3, :3], atol=1e-12)
    assert [w for w in result.warnings if "the position in the camera file is not used" in w]
    with pytest.raises(InputError, match="ground_height"):
        run(teddy, camera_file(replace(teddy.camera, world_from_camera=pose), ground_height=0.0))


def test_a_stated_size_overrules_a_pose(teddy, camera_file):
    result = run(teddy, camera_file(teddy.camera), size=0.6)
    assert extent_of(teddy.mask, result, "solid") == pytest.approx(0.6, rel=1e-3)
    assert "stated" in result.scale_source
    assert len(result.warnings) == 1


def test_without_a_file_everything_is_said(teddy):
    result = run(teddy)
    assert result.ground_height == 0.0
    assert "70° assumed" in result.camera_source
    assert "50°" in result.camera_source
    assert "default" in result.camera_source
    assert "estimated from the image" in result.ground_source
    assert result.scale_source.startswith("assumed")
    assert any("gravity" in warning for warning in result.warnings)
    assert extent_of(teddy.mask, result, "solid") == pytest.approx(0.3, rel=1e-3)
    assert result.camera.forward[2] == pytest.approx(-np.sin(np.deg2rad(50)), abs=1e-9)


def test_a_stated_size_is_kept(teddy):
    result = run(teddy, size=0.21)
    assert extent_of(teddy.mask, result, "solid") == pytest.approx(0.21, rel=1e-3)
    assert result.scale_source.startswith("stated")


def test_intrinsics_alone_are_used_and_the_pose_estimated(teddy, camera_file):
    result = run(teddy, camera_file(teddy.camera, pose=False))
    np.testing.assert_allclose(result.camera.intrinsics, teddy.camera.intrinsics)
    assert "camera file" in result.camera_source
    assert result.ground_height == 0.0


def test_an_object_in_the_air_has_no_ground(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    result = run(scene, size=0.12)
    assert result.ground_height is None
    assert "held in the air" in result.ground_source
    assert result.camera.project(np.zeros((1, 3)))[1][0] == pytest.approx(0.6, rel=0.25)  # another lens


def test_depth_fixes_gravity_ground_and_scale(scene_of, camera_file):
    scene = scene_of([((0, 0, 0.05), (0.06, 0.05, 0.05))], pitch=38.0)
    result = run(scene, camera_file(scene.camera, pose=False), depth=scene.depth)
    assert result.ground_height == 0.0
    assert result.camera.position[2] == pytest.approx(scene.camera.position[2], rel=0.01)
    assert result.camera.forward[2] == pytest.approx(-np.sin(np.deg2rad(38.0)), abs=0.01)
    assert "depth" in result.scale_source
    assert "depth" in result.ground_source


def test_depth_measures_so_a_stated_size_is_ignored(scene_of, camera_file):
    scene = scene_of([((0, 0, 0.05), (0.06, 0.05, 0.05))])
    file = camera_file(scene.camera, pose=False)
    plain, sized = (run(scene, file, size=size, depth=scene.depth) for size in (None, 2.0))
    np.testing.assert_array_equal(plain.camera.world_from_camera, sized.camera.world_from_camera)
    assert any("ignored" in warning for warning in sized.warnings)


def test_depth_that_is_not_used_leaves_a_stated_size_its_place(teddy, scene_of, camera_file):
    file = camera_file(teddy.camera, ground_height=0.0)
    outline = run(teddy, file, size=0.6, depth=teddy.depth)
    assert extent_of(teddy.mask, outline, "solid") == pytest.approx(0.6, rel=1e-3)
    assert "depth is not used: the camera file's pose and ground fix the scale" in outline.warnings
    filled = run(teddy, file, size=0.6, depth=teddy.depth, filled=True)
    np.testing.assert_allclose(filled.camera.position, teddy.camera.position, atol=1e-12)
    assert filled.warnings == ("the stated size of 0.6 m is ignored: depth measures lengths",)
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    hole = run(scene, camera_file(scene.camera, pose=False), size=0.12, depth=np.zeros(scene.mask.shape))
    assert hole.scale_source == "stated: the object's largest extent is 0.12 m"


def test_depth_without_a_plane_still_fixes_the_distance(scene_of, camera_file):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    depth = np.where(scene.mask, scene.depth, 0.0)
    result = run(scene, camera_file(scene.camera, pose=False), depth=depth)
    assert result.ground_height is None
    assert "depth" in result.scale_source
    assert result.camera.project(np.zeros((1, 3)))[1][0] == pytest.approx(0.555, abs=0.01)


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_impossible_sizes_are_refused(teddy, size):
    with pytest.raises(InputError, match="size of the object"):
        run(teddy, size=size)


def test_an_empty_keyframe_is_refused(teddy):
    nothing = np.zeros_like(teddy.masks.object)
    with pytest.raises(InputError, match="no object"):
        run(replace(teddy, masks=Masks(nothing, nothing, 0)))


def test_an_object_of_a_pixel_is_refused(teddy):
    dot = np.zeros_like(teddy.masks.object)
    dot[:, 70, 90] = True
    with pytest.raises(InputError, match="scene: the object covers only 1 pixels of the keyframe"):
        run(replace(teddy, masks=Masks(dot, np.zeros_like(dot), 0)))


def test_depth_needs_intrinsics(teddy):
    with pytest.raises(InputError, match="camera file"):
        run(teddy, depth=teddy.depth)


def test_the_same_clip_gives_the_same_calibration(teddy):
    first, second = run(teddy), run(teddy)
    assert first.camera.world_from_camera.tobytes() == second.camera.world_from_camera.tobytes()
    assert first.camera_source == second.camera_source


def test_surroundings_that_change_are_a_doubt(scene_of):
    """A camera that moves spoils masks and the hand's path."""
    clutter = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    assert any("if it is the camera, film with one at rest" in line for line in run(clutter).warnings)


def test_lengths_of_depth_are_said_to_be_of_depth(teddy, camera_file):
    file = camera_file(teddy.camera, ground_height=0.0)
    assert run(teddy, file, depth=teddy.depth, filled=True).scale_source == "depth in millimetres"
    assert run(teddy, file, depth=teddy.depth).scale_source == "pose and ground of the camera file"
