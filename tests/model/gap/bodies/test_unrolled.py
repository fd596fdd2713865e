"""Sheets laid out flat: distances in them are kept, and where they cannot be that is said."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from model.gap.bodies.unrolled import unrolled

LENGTH, WIDTH = 0.4, 0.3


@pytest.fixture
def flat():
    """180 points on a sheet, evenly but for a third of a spacing."""
    u, v = np.meshgrid(np.linspace(0, LENGTH, 15), np.linspace(0, WIDTH, 12), indexing="ij")
    places = np.stack([u, v], -1).reshape(-1, 2)
    return places + np.random.default_rng(0).uniform(-0.004, 0.004, places.shape)


def over(flat, radius):
    """Over a round beam of that radius, as far down on both sides as the sheet is long."""
    along = flat[:, 0] - LENGTH / 2
    angle = np.clip(along / radius, -np.pi / 2, np.pi / 2)
    down = np.abs(along) - radius * np.abs(angle)
    return np.stack([radius * np.sin(angle), flat[:, 1], radius * np.cos(angle) - down], -1)


def test_what_is_flat_is_seen_from_its_front(flat):
    for turn in Rotation.random(4, random_state=0):
        laid = unrolled(turn.apply(np.column_stack([flat, 0 * flat[:, 0]])))
        np.testing.assert_allclose(pdist(laid), pdist(flat), atol=1e-12)
        assert np.ptp(laid[:, 0]) > np.ptp(laid[:, 1])


@pytest.mark.parametrize("radius", [0.045, 0.06, 0.12])
def test_what_hangs_over_a_beam_is_unrolled(flat, radius):
    places = over(flat, radius)
    laid = unrolled(places)
    assert laid is not None
    off = np.abs(pdist(laid) - pdist(flat))
    assert off.mean() < 0.002
    assert off.max() < 0.01


def test_what_lies_on_itself_is_not_laid_out(flat):
    for radius in (0.005, 0.01, 0.02):
        assert unrolled(over(flat, radius)) is None


def test_two_pieces_are_not_laid_out(flat):
    bent = over(flat, 0.06)
    assert unrolled(np.concatenate([bent, bent + np.array([0.0, 2.0, 0.0])])) is None


def test_a_cap_is_laid_out_as_well_as_it_can_be(flat):
    """A sheet that hangs over a ball is stretched a little, whichever way it is laid out."""
    away = flat - flat.mean(0)
    far = np.linalg.norm(away, axis=1)
    angle = far / 0.25
    around = away * (0.25 * np.sin(angle) / far)[:, None]
    laid = unrolled(np.column_stack([around, 0.25 * np.cos(angle)]))
    assert laid is not None
    off = pdist(laid) / pdist(flat) - 1.0
    assert np.abs(off).mean() < 0.05
    assert np.abs(off).max() < 0.25
