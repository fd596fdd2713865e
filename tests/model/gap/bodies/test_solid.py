"""A lattice in a solid: the same however the solid lies, and in whatever order its points come."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.solid import SOLID_POINTS, lattice, spans_volume


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


def test_the_hole_of_a_ring_stays_empty(ring):
    """The surface is all around the middle of the hole, and yet it is outside."""
    points, _ = lattice(ring, 1.0)
    beside = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.1, points[:, 2])
    assert beside.max() < 0.0301
    assert (beside < 0.02).sum() > 20


def test_points_are_as_dense_in_a_ring_as_in_an_egg(ring, egg):
    """By the volume that it has, not by that of what it lies in."""
    _, spacing = lattice(ring, 1.0)
    volume = 2 * np.pi**2 * 0.1 * 0.03**2
    assert volume / spacing**3 == pytest.approx(SOLID_POINTS, rel=0.25)
    _, spacing = lattice(egg, 1.0)
    assert 4 / 3 * np.pi * 0.15 * 0.1 * 0.07 / spacing**3 == pytest.approx(SOLID_POINTS, rel=0.25)


@pytest.mark.parametrize("rounded", [np.float64, np.float32])
def test_points_in_one_plane_have_no_volume_to_fill(egg, rounded):
    """Nor where rounding parts them: cells as large as that would be millions."""
    turn = Rotation.from_rotvec([0.3, 0.5, 0.1])
    level = turn.apply(egg * [1.0, 1.0, 0.0]).astype(rounded).astype(np.float64)
    for places in (level, level[:4], egg[:3], egg[:1].repeat(5, 0)):
        assert not spans_volume(places)
        with pytest.raises(InputError, match="in one plane"):
            lattice(places, 1.0)
    noisy = level + np.random.default_rng(0).normal(0, 1e-3, level.shape)
    for places in (noisy, egg, egg[:4]):
        assert spans_volume(places)
        assert len(lattice(places, 1.0)[0]) >= 4
