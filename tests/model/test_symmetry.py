"""Reflection planes of point sets."""

import numpy as np
import pytest

from model.symmetry import find_reflections, mirror

SPACING = 0.05


def grid(*sides, seed=0):
    """A jittered box of points around the origin."""
    axes = [np.arange(-side / 2, side / 2 + 1e-9, SPACING) for side in sides]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points + np.random.default_rng(seed).uniform(-0.2, 0.2, points.shape) * SPACING


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


def one_sided():
    """A body with one limb: symmetric at x-y and nothing else, leaning in space."""
    body, limb = grid(0.6, 0.4, 0.2), grid(0.2, 0.8, 0.2) + np.array([0.45, 0.3, 0.0])
    return np.concatenate([body, limb])


def test_mirroring_twice_is_nothing():
    points = np.random.default_rng(0).standard_normal((20, 3))
    normal = np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(mirror(mirror(points, normal, 0.3), normal, 0.3), points, atol=1e-12)


def test_a_bump_on_one_side_does_not_tilt_the_plane():
    """Principal axes and centroid lean towards it; the overlap of the rest does not."""
    bump = grid(0.15, 0.15, 0.3) + np.array([-0.2, -0.1, 0.25])
    found = find_reflections(np.concatenate([one_sided(), bump]), tolerance=SPACING)
    assert abs(found[0].normal[2]) > np.cos(np.deg2rad(2.0))
    assert abs(found[0].offset) < 0.25 * SPACING


@pytest.mark.parametrize("seed", range(4))
def test_the_one_plane_of_a_lopsided_body_is_found_wherever_it_lies(seed):
    turn, shift = rotation(seed), np.array([1.0, -2.0, 0.5])
    found = find_reflections(one_sided() @ turn.T + shift, tolerance=1.5 * SPACING, min_overlap=0.95)
    assert len(found) == 1
    assert abs(found[0].normal @ turn[:, 2]) > 0.99
    assert found[0].offset == pytest.approx(found[0].normal @ shift, abs=SPACING)
    assert found[0].overlap > 0.95


def test_a_box_has_three_planes_and_they_are_distinct():
    found = find_reflections(grid(0.9, 0.6, 0.3), tolerance=1.5 * SPACING)
    normals = np.abs([each.normal for each in found])
    assert len(found) == 3
    assert sorted(normals.argmax(axis=1)) == [0, 1, 2]
    assert (normals.max(axis=1) > 0.98).all()


def test_a_random_shape_has_none():
    rng = np.random.default_rng(3)
    blobs = [grid(*rng.uniform(0.1, 0.3, 3), seed=k) + rng.uniform(-0.6, 0.6, 3) for k in range(5)]
    assert find_reflections(np.concatenate(blobs), tolerance=SPACING) == []


def test_a_given_direction_is_tried():
    """The scan alone would have to come near it by chance: with a tiny limit the hint decides."""
    turn = rotation(7)
    points = one_sided() @ turn.T
    hinted = find_reflections(points, 1.5 * SPACING, directions=(turn[:, 2],), limit=1)
    assert abs(hinted[0].normal @ turn[:, 2]) > 0.995


def test_same_points_same_planes():
    first, second = (find_reflections(one_sided(), 1.5 * SPACING) for _ in range(2))
    assert [each.normal.tobytes() for each in first] == [each.normal.tobytes() for each in second]
