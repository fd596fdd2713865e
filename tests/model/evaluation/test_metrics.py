import cv2
import numpy as np
import pytest

from model.evaluation.metrics import (
    C1,
    PEAK_LIMIT,
    chamfer,
    matched_track_error,
    mean_over,
    psnr,
    silhouette_iou,
    ssim,
    ssim_map,
    track_error,
)

GRID = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), [0.0], indexing="ij"), -1).reshape(1, -1, 3)


def moved(*shift):
    return (GRID + np.array(shift)).astype(np.float32)


def test_chamfer_is_euclidean():
    # a shift across the plane of the points: the nearest one is the own one
    np.testing.assert_allclose(chamfer(moved(0, 0, 0), moved(0.3, 0, 0.4)), [0.5], rtol=1e-6)


def test_chamfer_forgives_points_that_change_places():
    shuffled = moved(0, 0, 0)[:, ::-1]
    assert chamfer(moved(0, 0, 0), shuffled)[0] == 0.0
    assert track_error(moved(0, 0, 0), shuffled)[0] > 1.0


def test_chamfer_goes_from_truth_to_prediction():
    more = np.concatenate([moved(0, 0, 0), moved(50.0, 0, 0)], axis=1)
    assert chamfer(moved(0, 0, 0), more)[0] == 0.0
    assert chamfer(more, moved(0, 0, 0))[0] > 20.0


def test_unknown_points_and_frames_do_not_count():
    truth = np.concatenate([moved(0, 0, 0), moved(0, 0, 0)])
    truth[0, 1:] = np.nan
    truth[1] = np.nan
    guess = np.concatenate([moved(0, 0, 2.0), moved(0, 0, 2.0)])
    guess[0, 1:] += 100.0
    for metric in (chamfer, track_error):
        found = metric(truth, guess)
        assert found[0] == pytest.approx(2.0)
        assert np.isnan(found[1])
        assert mean_over(found) == pytest.approx(2.0)
    assert mean_over(np.full(3, np.nan)) is None


def test_matching_as_the_field_does_follows_the_nearest_point_of_frame_0():
    truth = np.concatenate([moved(0, 0, 0), moved(0, 0, 1.0)])
    start = moved(0.7, 0, 0)[0]  # seen so wrongly that each point is taken for its neighbour, but at the edge
    start[0] = np.nan
    known = track_error(truth, truth)
    matched = matched_track_error(start, truth, truth)
    np.testing.assert_array_equal(known, [0.0, 0.0])
    # of the 11 points that were seen, 8 are one step off and 3 at the far edge are not
    np.testing.assert_allclose(matched, [8 / 11, 8 / 11], rtol=1e-6)


def test_matching_without_a_first_sighting_says_nothing():
    assert np.isnan(matched_track_error(np.full((12, 3), np.nan), moved(0, 0, 0), moved(0, 0, 0))).all()


def test_silhouettes():
    first, second = np.zeros((4, 6)), np.zeros((4, 6))
    first[:, :4] = 0.9
    second[:, 2:] = 0.8
    second[:, 5] = 0.4  # not solid
    assert silhouette_iou(first, second) == pytest.approx(2 / 5)
    assert silhouette_iou(np.zeros((4, 6)), np.zeros((4, 6))) == 1.0


def test_psnr_of_a_known_error():
    real, drawn = np.zeros((8, 8, 3)), np.zeros((8, 8, 3))
    drawn[2:4, 2:4] = 0.1
    there = np.zeros((8, 8), bool)
    there[2:4, 2:4] = True
    assert psnr(real, drawn, there) == pytest.approx(20.0)
    assert psnr(real, drawn) == pytest.approx(20.0 + 10.0 * np.log10(16.0))
    assert psnr(real, real) == PEAK_LIMIT


def test_ssim_of_flat_pictures_has_a_closed_form():
    a, b = 0.3, 0.5
    expected = (2 * a * b + C1) / (a * a + b * b + C1)
    assert ssim(np.full((20, 24, 3), a), np.full((20, 24, 3), b)) == pytest.approx(expected, rel=1e-9)


def test_ssim_sees_structure():
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.uniform(0, 1, (40, 40, 3)), (0, 0), 2.0)
    noisy = np.clip(picture + rng.normal(0, 0.02, picture.shape), 0, 1)
    noisier = np.clip(picture + rng.normal(0, 0.2, picture.shape), 0, 1)
    assert ssim(picture, picture) == pytest.approx(1.0)
    assert ssim(picture, noisy) > ssim(picture, noisier) > ssim(picture, 1.0 - picture)


def test_ssim_against_its_definition_at_one_pixel():
    rng = np.random.default_rng(1)
    first, second = rng.uniform(0, 1, (2, 11, 11, 3))
    offsets = np.arange(-5, 6)
    weight = np.exp(-(offsets[:, None] ** 2 + offsets[None] ** 2) / (2 * 1.5**2))
    weight = (weight / weight.sum())[..., None]

    def mean(values):
        return (weight * values).sum(axis=(0, 1))

    a, b = mean(first), mean(second)
    va, vb, vab = mean(first**2) - a**2, mean(second**2) - b**2, mean(first * second) - a * b
    expected = ((2 * a * b + C1) * (2 * vab + 0.03**2)) / ((a**2 + b**2 + C1) * (va + vb + 0.03**2))
    np.testing.assert_allclose(ssim_map(first, second)[5, 5], expected, rtol=1e-6)
