import numpy as np
import pytest

from model.reconstruction.fill import quaternions_to
from model.reconstruction.outline import coverage_of, overlap, silhouette_of
from model.types import Camera, Gaussians


def one(mean, scales, normal=(0.0, 0.0, 1.0), opacity=0.9):
    return Gaussians(
        means=np.array([mean], np.float32),
        scales=np.array([scales], np.float32),
        quaternions=quaternions_to(np.array([normal], np.float64)).astype(np.float32),
        opacities=np.array([opacity], np.float32),
        colors=np.zeros((1, 3), np.float32),
        volumes=np.ones(1, np.float32),
    )


CAMERA = Camera(np.array([[100.0, 0, 50], [0, 100.0, 40], [0, 0, 1]]), np.eye(4), 101, 81)


def test_one_gaussian_falls_off_as_it_must():
    alpha = coverage_of(one([0, 0, 2.0], [0.1, 0.1, 0.1]), CAMERA)
    variance = (0.1 * 100 / 2) ** 2 + 0.3
    assert alpha[40, 50] == pytest.approx(0.9, rel=1e-3)
    assert alpha[40, 55] == pytest.approx(0.9 * np.exp(-0.5 * 25 / variance), rel=1e-2)


def test_a_flat_gaussian_is_thin_edge_on():
    facing = silhouette_of(one([0, 0, 2.0], [0.2, 0.2, 0.01], (0, 0, 1)), CAMERA)
    edge_on = silhouette_of(one([0, 0, 2.0], [0.2, 0.2, 0.01], (1, 0, 0)), CAMERA)
    assert facing.sum() > 3 * edge_on.sum()
    assert np.ptp(np.nonzero(edge_on)[0]) > 3 * np.ptp(np.nonzero(edge_on)[1])


def test_what_is_behind_the_camera_or_beside_the_image_is_not_seen():
    assert not coverage_of(one([0, 0, -2.0], [0.1] * 3), CAMERA).any()
    assert not coverage_of(one([9.0, 0, 2.0], [0.1] * 3), CAMERA).any()


def test_overlap_counts():
    first = np.zeros((4, 4), bool)
    first[:2] = True
    second = np.zeros((4, 4), bool)
    second[1:3] = True
    assert overlap(first, second) == pytest.approx(1 / 3)
    assert overlap(first, first) == 1.0
    assert overlap(np.zeros((2, 2), bool), np.zeros((2, 2), bool)) == 1.0
