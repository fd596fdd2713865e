import numpy as np
import pytest

from model.scenes.capsules import chain, union


def test_distance_to_a_capsule_is_exact():
    body = chain((0.0, 0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.1))
    points = np.array([[0.5, 0.3, 0], [-0.4, 0, 0.3], [0.2, 0.05, 0.0]])
    distance, normal = body.field(points)
    np.testing.assert_allclose(distance, [0.2, 0.4, -0.05], atol=1e-9)
    np.testing.assert_allclose(normal, [[0, 1, 0], [-0.8, 0, 0.6], [0, 1, 0]], atol=1e-9)


def test_surface_points_lie_on_the_surface_everywhere():
    body = union(chain((0.0, 0.0, 0.0, 0.03), (0.1, 0.0, 0.0, 0.02)), chain((0.05, 0.1, 0.0, 0.02)))
    surface = body.surface(0.005)
    assert np.abs(body.distance(surface)).max() < 5e-4
    rng = np.random.default_rng(0)
    probes = rng.uniform([-0.05, -0.05, -0.05], [0.15, 0.15, 0.05], (20000, 3))
    near = probes[np.abs(body.distance(probes)) < 5e-4]
    gaps = np.linalg.norm(near[:, None] - surface, axis=2).min(axis=1)
    assert gaps.max() < 0.009


def test_filling_stays_below_the_surface_and_covers_the_volume():
    body, spacing = chain((0.0, 0.0, 0.0, 0.05)), 0.008
    inside = body.fill(spacing, 0.004, np.random.default_rng(0))
    radii = np.linalg.norm(inside, axis=1)
    assert radii.max() < 0.046
    assert len(inside) * spacing**3 == pytest.approx(4 / 3 * np.pi * 0.046**3, rel=0.05)
    np.testing.assert_array_equal(inside, body.fill(spacing, 0.004, np.random.default_rng(0)))


def test_owners_tell_parts_apart():
    body = union(chain((0.0, 0.0, 0.0, 0.02), (0.1, 0.0, 0.0, 0.02)), chain((0.3, 0.0, 0.0, 0.02)))
    owner, along = body.owners(np.array([[0.025, 0.02, 0], [0.31, 0, 0]]))
    np.testing.assert_array_equal(owner, [0, 1])
    assert along[0] == pytest.approx(0.25)
