import numpy as np
import pytest
from scipy.spatial import cKDTree

from model.reconstruction.fill import fill, quaternions_to, thinned
from model.reconstruction.outline import rotations_of
from model.reconstruction.volume import Volume, grid_around


def body(center=(0.0, 0.0, 0.05), radius=0.05):
    center = np.array(center)
    shape, origin, spacing = grid_around(center - radius, center + radius, np.eye(3), 0.002)
    empty = Volume(np.zeros(shape, np.float32), origin, np.eye(3), spacing)
    distance = radius - np.linalg.norm(empty.points - center, axis=-1)
    return Volume(distance.astype(np.float32), origin, np.eye(3), spacing)


@pytest.fixture(scope="module")
def ball():
    return body()


@pytest.fixture(scope="module")
def filling(ball):
    return fill(ball)


def test_the_count_is_near_the_target(filling):
    assert 6_000 <= len(filling.means) <= 12_000


def test_volumes_are_positive_and_sum_to_the_body(ball, filling):
    assert filling.volumes.min() > 0
    assert filling.volumes.sum() == pytest.approx(ball.total, rel=1e-9)


def test_there_is_a_surface_and_an_inside(ball, filling):
    depth = ball.sample(filling.means)
    assert depth.min() > 0
    assert depth[filling.surface].max() < 3 * filling.spacing
    inside = filling.means[~filling.surface]
    assert np.linalg.norm(inside - [0, 0, 0.05], axis=1).min() < 0.01
    outward = (filling.means - [0, 0, 0.05])[filling.surface]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.einsum("gi,gi->g", outward, filling.normals[filling.surface]).min() > 0.9


def test_no_hole_and_no_heap(ball, filling):
    points = ball.points[ball.distance > 0]
    gap, _ = cKDTree(filling.means).query(points)
    assert gap.max() < 2.2 * filling.spacing
    apart, _ = cKDTree(filling.means).query(filling.means, k=2)
    assert apart[:, 1].min() > 0.5 * filling.spacing


def test_what_rests_on_the_floor_keeps_its_contact(ball, filling):
    standing = fill(ball, floor=0.0)
    assert standing.means[:, 2].min() < 0.5 * standing.spacing
    assert standing.means[:, 2].min() < filling.means[:, 2].min()


def test_the_same_body_gives_the_same_bytes(ball, filling):
    again = fill(ball)
    for name in ("means", "normals", "scales", "volumes"):
        assert getattr(again, name).tobytes() == getattr(filling, name).tobytes()


def test_painted_gaussians_are_unit_and_finite(filling):
    gaussians = filling.painted(np.full((len(filling.means), 3), 1.7), ("note",))
    np.testing.assert_allclose(np.linalg.norm(gaussians.quaternions, axis=1), 1.0, atol=1e-6)
    assert gaussians.colors.max() == 1.0
    assert gaussians.warnings == ("note",)
    assert np.isfinite(gaussians.means).all()
    assert gaussians.scales.min() > 0


def test_quaternions_turn_z_to_the_normal():
    normals = np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0], [0.6, 0, -0.8], [0, 0, 0]])
    rotation = rotations_of(quaternions_to(normals))
    np.testing.assert_allclose(rotation[:4, :, 2], normals[:4], atol=1e-9)
    np.testing.assert_allclose(rotation[4], np.eye(3), atol=1e-12)


def test_thinned_points_are_apart_and_no_more_would_fit():
    points = np.random.default_rng(0).uniform(0, 1, (3000, 3))
    kept = points[thinned(points, 0.1)]
    apart, _ = cKDTree(kept).query(kept, k=2)
    assert apart[:, 1].min() > 0.1
    gap, _ = cKDTree(kept).query(points)
    assert gap.max() <= 0.1
