"""A lattice in a solid: the same however the solid lies, and in whatever order its points come."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.gap.bodies.solid import lattice


@pytest.fixture
def egg():
    """200 points all over an egg of 0.3 × 0.2 × 0.14 m, none of which is like another."""
    i = np.arange(200) + 0.5
    z, angle = 1 - i / 100, np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle) * 0.15, across * np.sin(angle) * 0.1, 0.07 * z], -1)


def test_it_fills_the_solid(egg):
    points, spacing = lattice(egg, 1.0)
    inside = np.linalg.norm(points / [0.15, 0.1, 0.07], axis=1) < 0.8
    assert inside.sum() > 20
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    assert nearest.min() > 0.5 * spacing
    somewhere = np.random.default_rng(0).uniform(-1, 1, (500, 3)) * [0.15, 0.1, 0.07]
    within = somewhere[np.linalg.norm(somewhere / [0.15, 0.1, 0.07], axis=1) < 0.9]
    assert cKDTree(points).query(within)[0].max() < 1.2 * spacing


def test_turned_shifted_and_in_another_order_it_is_the_same(egg):
    turn, shift = Rotation.from_rotvec([0.2, -0.4, 1.0]), np.array([1.0, 2.0, -0.5])
    order = np.random.default_rng(1).permutation(len(egg))
    one, spacing = lattice(egg, 1.0)
    other, again = lattice(turn.apply(egg[order]) + shift, 1.0)
    assert again == pytest.approx(spacing)
    assert len(other) == len(one)
    assert cKDTree(turn.apply(one) + shift).query(other)[0].max() < 1e-9
