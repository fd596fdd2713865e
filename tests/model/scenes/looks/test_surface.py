from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from model.scenes.looks.surface import surface_of


def test_a_ball_has_a_round_even_closed_surface(ball):
    surface = surface_of(ball, 0.005, np.random.default_rng(0))
    radius = np.linalg.norm(surface.points, axis=1)
    assert radius.mean() == pytest.approx(0.050, abs=0.003)
    assert radius.std() < 0.0012
    outward = surface.points / radius[:, None]
    assert (surface.normals * outward).sum(axis=1).min() > 0.9
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1, atol=1e-9)
    # No hole: every direction has a point nearby.
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions *= radius.mean() / np.linalg.norm(directions, axis=1, keepdims=True)
    assert cKDTree(surface.points).query(directions)[0].max() < 0.008
    assert np.median(cKDTree(surface.points).query(surface.points, 2)[0][:, 1]) > 0.0025
    np.testing.assert_array_equal(surface.owner, cKDTree(ball.means).query(surface.points)[1])


def test_it_passes_through_known_points(ball):
    known = np.random.default_rng(2).normal(size=(80, 3))
    known *= 0.050 / np.linalg.norm(known, axis=1, keepdims=True)
    surface = surface_of(ball, 0.005, np.random.default_rng(0), known.astype(np.float32))
    assert np.linalg.norm(surface.points, axis=1).mean() == pytest.approx(0.050, abs=0.0008)


def test_a_sheet_has_two_sides_and_stays_thin(ball):
    grid = np.arange(-0.05, 0.051, 0.01)
    flat = np.stack(np.meshgrid(grid, grid, [0.0], indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)
    count = len(flat)
    sheet = replace(
        ball,
        means=flat,
        scales=np.tile(np.array([0.006, 0.006, 0.0018], np.float32), (count, 1)),
        quaternions=ball.quaternions[:count],
        opacities=ball.opacities[:count],
        colors=ball.colors[:count],
        volumes=np.full(count, 1e-4 * 0.001, np.float32),
    )
    surface = surface_of(sheet, 0.004, np.random.default_rng(0), flat)
    inside = np.abs(surface.points[:, :2]).max(axis=1) < 0.04
    heights = surface.points[inside, 2]
    assert 0.0002 < np.abs(heights).min()
    assert np.abs(heights).max() < 0.003
    up = surface.normals[inside, 2]
    assert (np.abs(up) > 0.9).all()
    np.testing.assert_array_equal(up > 0, heights > 0)
    assert 0.4 < (up > 0).mean() < 0.6
