from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.reconstruction.outline import overlap, silhouette_of
from model.reconstruction.silhouette import (
    SHEET_THICKNESS,
    SilhouetteReconstructor,
    body_of,
    completed_mask,
)
from model.types import Masks


def run(scene, shape_class, ground=0.0):
    return SilhouetteReconstructor()(scene.frames, scene.masks, scene.calibration(ground), shape_class)


def covered(scene, gaussians):
    return overlap(silhouette_of(gaussians, scene.camera), scene.mask)


@pytest.mark.parametrize("pitch", [30.0, 50.0, 75.0])
def test_a_lying_body_projects_back_onto_its_mask(scene_of, pitch):
    limbs = [((s * 0.07, y, 0.02), (0.05, 0.02, 0.02)) for s in (-1, 1) for y in (-0.04, 0.04)]
    scene = scene_of([((0, 0, 0.04), (0.04, 0.06, 0.04)), *limbs], pitch=pitch)
    gaussians = run(scene, "solid")
    assert covered(scene, gaussians) > 0.93
    assert gaussians.warnings == ()
    assert gaussians.means[:, 2].min() > 0
    assert gaussians.means[:, 2].min() < 0.005


def test_a_rope_has_the_volume_of_its_cylinder(strand):
    gaussians = run(strand, "rope")
    truth = np.pi * 0.012**2 * 0.216 + 4 / 3 * np.pi * 0.012**3
    assert gaussians.volumes.sum() == pytest.approx(truth, rel=0.15)
    body = body_of(strand.mask, strand.calibration(), "rope")
    extents = np.ptp(body.points[body.distance > 0], axis=0)
    np.testing.assert_allclose(extents, [0.24, 0.024, 0.024], atol=0.005)  # pixels of 3.5 mm
    assert covered(strand, gaussians) > 0.85


def test_a_body_has_roughly_its_true_volume(teddy):
    gaussians = run(teddy, "solid")
    # Limbs inside the trunk count once; they are small, so the sum is an upper bound near the truth.
    truth = 4 / 3 * np.pi * (0.04 * 0.055 * 0.04 + 0.035**3)
    assert 0.6 * truth < gaussians.volumes.sum() < 1.5 * truth
    assert 6_000 <= len(gaussians) <= 12_000


def test_a_sheet_is_one_layer_on_the_ground(teddy):
    gaussians = run(teddy, "sheet")
    assert np.ptp(gaussians.means[:, 2]) < 1e-6
    assert gaussians.means[0, 2] == pytest.approx(0.5 * SHEET_THICKNESS)
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    rows, columns = np.nonzero(teddy.mask)
    pixels = np.stack([columns, rows], -1)[:, None] + corners
    rays = teddy.camera.unproject(pixels, np.ones(pixels.shape[:-1])) - teddy.camera.position
    ground = teddy.camera.position - rays * (teddy.camera.position[2] / rays[..., 2:])
    diagonals = ground[:, 2] - ground[:, 0], ground[:, 3] - ground[:, 1]
    area = 0.5 * np.abs(np.cross(*diagonals)[:, 2]).sum()
    assert gaussians.volumes.sum() == pytest.approx(area * SHEET_THICKNESS, rel=0.03)
    assert covered(teddy, gaussians) > 0.95


@pytest.mark.parametrize("shape_class", ["solid", "rope", "sheet"])
def test_without_a_ground_the_body_hangs_around_the_origin(scene_of, shape_class):
    scene = scene_of([((0, 0, 0), (0.1, 0.04, 0.03))], table=False)
    gaussians = run(scene, shape_class, ground=None)
    assert covered(scene, gaussians) > 0.93
    depth = scene.camera.to_camera(gaussians.means)[:, 2]
    assert depth.mean() == pytest.approx(0.6, abs=0.01)
    assert abs((depth.max() + depth.min()) / 2 - 0.6) < 0.01


def test_colours_are_those_of_the_image(teddy):
    gaussians = run(teddy, "solid")
    left, right = gaussians.means[:, 0] < -0.02, gaussians.means[:, 0] > 0.02
    np.testing.assert_allclose(np.median(gaussians.colors[left], 0) * 255, [180, 60, 40], atol=3)
    np.testing.assert_allclose(np.median(gaussians.colors[right], 0) * 255, [40, 70, 180], atol=3)


def test_the_object_goes_on_a_little_under_the_hand(teddy):
    rows = np.arange(teddy.mask.shape[0])[:, None]
    cut = teddy.mask & (rows > 62)
    hand = np.zeros_like(cut)
    hand[:63] = True
    grown = completed_mask(cut, hand) & ~cut
    assert grown.any()
    assert not np.any(grown & ~hand)
    reached = np.nonzero(grown.any(axis=1))[0]
    assert 62 - reached.min() <= 2  # four pixels of 480, on 150 lines
    assert np.array_equal(completed_mask(teddy.mask, np.zeros_like(hand)), teddy.mask)


def test_too_few_pixels_are_refused(teddy):
    few = np.zeros_like(teddy.masks.object)
    few[:, 70:73, 100:104] = True
    with pytest.raises(InputError, match="12 pixels"):
        run(replace(teddy, masks=Masks(few, np.zeros_like(few), 0)), "solid")


@pytest.mark.parametrize("shape_class", ["solid", "sheet"])
def test_the_same_clip_gives_the_same_bytes(teddy, shape_class):
    first, second = run(teddy, shape_class), run(teddy, shape_class)
    for name in ("means", "scales", "quaternions", "opacities", "colors", "volumes"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
