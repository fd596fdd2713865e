import numpy as np
import pytest

from model.scenes.looks.viewpoint import draw_camera


@pytest.mark.parametrize("seed", range(8))
def test_all_that_happens_is_in_the_picture_and_fills_it(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform([-0.2, -0.1, 0.0], [0.3, 0.1, rng.uniform(0.02, 0.5)], (300, 3)) + rng.normal(size=3)
    camera = draw_camera(points, (160, 120), rng)
    pixels, depth = camera.project(points)
    assert (depth > 0).all()
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert (low > 5).all()
    assert (high < [154, 114]).all()
    assert ((high - low) / [160, 120]).max() == pytest.approx(0.74, abs=0.06)
    np.testing.assert_allclose((low + high) / 2, [79.5, 59.5], atol=5)
    assert camera.forward[2] < -0.3  # from above


def test_cameras_stand_anywhere_around():
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 3))
    cameras = [draw_camera(points, (80, 60), np.random.default_rng(seed)) for seed in range(12)]
    around = np.array([np.arctan2(camera.position[1], camera.position[0]) for camera in cameras])
    assert np.ptp(around) > 3
