import numpy as np
import pytest

from model.errors import InputError
from model.reconstruction.depth import DepthReconstructor, body_behind, surface_depth
from model.reconstruction.outline import overlap, silhouette_of


@pytest.fixture
def written(tmp_path):
    def write(depth):
        path = tmp_path / "depth.png.npy"
        np.save(path, np.round(depth * 1000).astype(np.uint16))
        return path

    return write


def noisy(scene):
    """Depth as a sensor gives it: 1.5 mm of noise, holes, and mixed pixels along the object's edge."""
    rng = np.random.default_rng(0)
    depth = scene.depth + rng.normal(0, 0.0015, scene.depth.shape)
    edge = scene.mask & ~np.roll(scene.mask, 1, axis=1)
    depth[edge] += 0.08
    depth[rng.uniform(size=depth.shape) < 0.1] = 0.0
    return depth


def run(scene, path, shape_class="solid", ground=0.0):
    return DepthReconstructor(path)(scene.frames, scene.masks, scene.calibration(ground), shape_class)


def test_a_ball_on_a_table_comes_back(scene_of, written):
    scene = scene_of([((0.02, 0.01, 0.06), (0.06, 0.06, 0.06))])
    gaussians = run(scene, written(noisy(scene)))
    assert overlap(silhouette_of(gaussians, scene.camera), scene.mask) > 0.9
    assert gaussians.means[:, 2].min() > 0
    assert gaussians.means[:, 2].max() == pytest.approx(0.12, abs=0.01)
    middle = gaussians.means[:, :2].mean(0)
    np.testing.assert_allclose(middle, [0.02, 0.01], atol=0.012)
    assert gaussians.volumes.sum() == pytest.approx(4 / 3 * np.pi * 0.06**3, rel=0.3)
    assert gaussians.warnings == ()


@pytest.mark.parametrize("pitch", [30.0, 45.0, 60.0, 80.0])
@pytest.mark.parametrize("radii", [(0.08, 0.05, 0.04), (0.06, 0.06, 0.06), (0.07, 0.07, 0.025)])
def test_what_lies_on_the_ground_reaches_it(scene_of, pitch, radii):
    """Its underside is not seen."""
    scene = scene_of([((0.0, 0.0, radii[2]), radii)], pitch=pitch)
    front, _ = surface_depth(scene.depth, scene.mask, scene.mask)
    body = body_behind(front, scene.mask, scene.calibration())
    assert body.points[..., 2][body.distance > 0].min() < 0.008
    assert body.total == pytest.approx(4 / 3 * np.pi * np.prod(radii), rel=0.45)


def test_what_is_held_above_the_ground_does_not(scene_of):
    radii = (0.05, 0.05, 0.05)
    scene = scene_of([((0.0, 0.0, 0.2), radii)])
    front, _ = surface_depth(scene.depth, scene.mask, scene.mask)
    body = body_behind(front, scene.mask, scene.calibration())
    assert body.points[..., 2][body.distance > 0].min() > 0.12


def test_the_measured_front_is_kept(scene_of, written):
    scene = scene_of([((0, 0, 0.03), (0.08, 0.05, 0.03))])
    gaussians = run(scene, written(noisy(scene)))
    outside = np.linalg.norm(gaussians.means / [0.08, 0.05, 0.03] - [0, 0, 1], axis=1)
    towards = gaussians.means @ (scene.camera.position / np.linalg.norm(scene.camera.position))
    assert np.quantile(outside[towards > np.quantile(towards, 0.6)], 0.9) < 1.08


def test_a_sheet_is_one_layer_on_the_measured_surface(scene_of, written):
    scene = scene_of([((0, 0, 0.002), (0.12, 0.09, 0.004))])
    gaussians = run(scene, written(scene.depth), "sheet")
    assert overlap(silhouette_of(gaussians, scene.camera), scene.mask) > 0.85
    assert gaussians.volumes.sum() == pytest.approx(np.pi * 0.12 * 0.09 * 0.002, rel=0.1)
    assert np.std(gaussians.means[:, 2]) < 0.004


def test_an_object_in_the_air_gets_a_round_back(scene_of, written):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    depth = np.where(scene.mask, scene.depth, 2.5)
    gaussians = run(scene, written(depth), ground=None)
    inside = scene.camera.to_camera(gaussians.means)[:, 2]
    assert np.ptp(inside) == pytest.approx(0.09, abs=0.02)  # centres lie inside
    assert overlap(silhouette_of(gaussians, scene.camera), scene.mask) > 0.9


def test_flying_pixels_and_holes_do_not_reach_the_surface(scene_of):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    front, measured = surface_depth(noisy(scene), scene.mask, scene.mask)
    assert 0.6 < measured <= 1.0
    error = np.abs(front - scene.depth)[scene.mask]
    assert np.median(error) < 0.0015
    assert error.max() < 0.03


@pytest.mark.parametrize(("shape_class", "sunk"), [("solid", 0.0), ("rope", 0.1), ("sheet", 0.1)])
def test_an_object_on_or_below_the_ground_is_refused(scene_of, written, shape_class, sunk):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    rays = scene.camera.unproject(np.argwhere(scene.mask)[:, ::-1].astype(float), np.ones(scene.mask.sum()))
    ground = -scene.camera.position[2] / (rays - scene.camera.position)[:, 2]
    depth = scene.depth.copy()
    depth[scene.mask] = ground + 1e-3 + sunk
    with pytest.raises(InputError, match="of the object's depth lies above the ground"):
        run(scene, written(depth), shape_class)


def test_an_object_without_depth_is_refused(scene_of, written):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    with pytest.raises(InputError, match="0% of the object"):
        run(scene, written(np.where(scene.mask, 0.0, scene.depth)))


def test_sparse_depth_is_a_warning(scene_of, written):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    holes = np.random.default_rng(0).uniform(size=scene.depth.shape) < 0.5
    gaussians = run(scene, written(np.where(holes, 0.0, scene.depth)))
    assert any("no usable depth" in warning for warning in gaussians.warnings)


def test_the_same_depth_gives_the_same_bytes(scene_of, written):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    path = written(noisy(scene))
    assert run(scene, path).means.tobytes() == run(scene, path).means.tobytes()
