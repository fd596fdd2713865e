import numpy as np
import pytest

from model.reconstruction.scale import centred, floating, foot_of, meets, sized
from model.reconstruction.silhouette import extent_of
from model.types import Camera


def inflated(scene, shape_class="solid"):
    """How large the silhouette of a scene is in a world."""
    return lambda world: extent_of(scene.mask, world, shape_class)


@pytest.mark.parametrize("shape_class", ["solid", "rope", "sheet"])
def test_the_extent_becomes_the_size(teddy, shape_class):
    result = sized(teddy.masks, teddy.calibration(), 0.5, "stated", inflated(teddy, shape_class))
    assert extent_of(teddy.mask, result, shape_class) == pytest.approx(0.5, rel=1e-3)
    assert "0.5 m" in result.scale_source
    pixels, _ = result.camera.project(np.zeros((1, 3)))
    np.testing.assert_allclose(pixels[0], teddy.camera.project(np.zeros((1, 3)))[0][0], atol=6)


def test_a_large_disagreement_with_what_was_known_is_a_warning(teddy):
    known = teddy.calibration()
    known = type(known)(**{**vars(known), "scale_source": "the camera file"})
    agreed = sized(teddy.masks, known, extent_of(teddy.mask, known, "solid"), "stated", inflated(teddy))
    assert agreed.warnings == ()
    assert "instead of the camera file" in agreed.scale_source
    doubted = sized(teddy.masks, known, 1.0, "stated", inflated(teddy))
    assert len(doubted.warnings) == 1


def test_a_floating_object_becomes_the_origin(scene_of):
    scene = scene_of([((0.05, 0.06, 0.05), (0.06, 0.06, 0.06))], table=False)
    result = floating(scene.masks, scene.calibration(None), 0.12, inflated(scene))
    pixels, depth = result.camera.project(np.zeros((1, 3)))
    rows, columns = np.nonzero(scene.mask)
    np.testing.assert_allclose(pixels[0], [columns.mean(), rows.mean()], atol=1e-6)
    true_depth = scene.camera.to_camera(np.array([[0.05, 0.06, 0.05]]))[0, 2]
    assert depth[0] == pytest.approx(true_depth, rel=0.06)
    assert "stated" in result.scale_source


def test_a_measured_depth_fixes_a_floating_object(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    result = floating(scene.masks, scene.calibration(None), None, inflated(scene), 0.77)
    assert result.camera.project(np.zeros((1, 3)))[1][0] == pytest.approx(0.77)
    assert "depth" in result.scale_source


def test_without_size_the_default_is_assumed_and_said(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    result = floating(scene.masks, scene.calibration(None), None, inflated(scene))
    assert result.scale_source.startswith("assumed")
    assert extent_of(scene.mask, result, "solid") == pytest.approx(0.3, rel=0.01)


def test_the_foot_lies_on_the_ground_under_the_mask(teddy):
    foot = foot_of(teddy.camera, teddy.mask, 0.1)
    assert foot[2] == pytest.approx(0.1)
    moved = centred(teddy.camera, teddy.mask)
    np.testing.assert_allclose(foot_of(moved, teddy.mask, 0.0), 0.0, atol=1e-12)


def test_rays_above_the_horizon_do_not_meet_the_ground(scene_of):
    level = scene_of([((0, 0, 0.2), (0.06, 0.06, 0.06))], pitch=5.0)
    assert not meets(level.camera, level.mask, 0.0)
    steep = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))], pitch=50.0)
    assert meets(steep.camera, steep.mask, 0.0)
    below = Camera(steep.camera.intrinsics, np.eye(4), 200, 150)
    assert not meets(below, steep.mask, 0.0)
