from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.looks import LONGEST_SIDE, looks_of
from model.evaluation.metrics import PEAK_LIMIT
from model.evaluation.pictures import Pictures
from model.views import overview


def test_looks_follow_the_observed_points(dressed):
    looks = looks_of(dressed, dressed.complete)
    assert (looks.camera.width, looks.camera.height) == (LONGEST_SIDE, 3 * LONGEST_SIDE // 4)
    shift = np.array([0.05, 0.0, 0.03], np.float32)
    for before, after in zip(
        looks.pictures(dressed.rest[None]), looks.pictures((dressed.rest + shift)[None]), strict=True
    ):
        np.testing.assert_allclose(after.means, before.means + shift, atol=1e-5)
        assert before.alpha.max() > 0.9
        # red on the left of the picture, blue on the right, as they are in the world
        red, blue = (before.color[..., k].sum(axis=0) for k in (0, 2))
        columns = np.arange(LONGEST_SIDE)
        assert (red @ columns) / red.sum() < (blue @ columns) / blue.sum()


def test_a_case_is_seen_by_its_own_camera(dressed):
    own = overview(dressed.complete, 480, 480)
    looks = looks_of(replace(dressed, camera=own), dressed.complete)
    assert (looks.camera.width, looks.camera.height) == (LONGEST_SIDE, LONGEST_SIDE)
    np.testing.assert_array_equal(looks.camera.world_from_camera, own.world_from_camera)


def test_a_camera_is_placed_where_it_sees_all_of_the_motion(dressed):
    looks = looks_of(dressed, dressed.complete)
    pixels, _ = looks.camera.project(dressed.complete.reshape(-1, 3))
    assert (pixels > 0).all()
    assert (pixels < [looks.camera.width, looks.camera.height]).all()


def test_right_pictures_and_wrong_ones(dressed):
    frames = range(1, 10)
    right = Pictures().scores(dressed, dressed.complete, frames)
    assert right == pytest.approx(
        {"iou": 1.0, "psnr": PEAK_LIMIT, "psnr_object": PEAK_LIMIT, "ssim": 1.0}, abs=1e-6
    )
    held = np.repeat(dressed.rest[None], 10, axis=0)
    wrong = Pictures().scores(dressed, held, frames)
    assert wrong["iou"] < 0.9
    assert wrong["ssim"] < 0.99
    # the empty background flatters
    assert wrong["psnr_object"] < wrong["psnr"] < PEAK_LIMIT


def test_looks_or_truth_that_are_not_there(dressed, make_case):
    plain = make_case(frames=6)
    assert Pictures().scores(plain, plain.complete, range(6)) == {}
    unknown = dressed.complete.copy()
    unknown[3, 0] = np.nan
    gappy = replace(dressed, complete=None, observation=replace(dressed.observation, points=unknown))
    assert Pictures().scores(gappy, dressed.complete, range(1, 10)) == {}
    assert Pictures().scores(dressed, dressed.complete, range(0)) == {}
