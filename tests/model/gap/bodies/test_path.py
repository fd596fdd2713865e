"""How far along an object its points are: from the same end whatever their order."""

import numpy as np

from model.gap.bodies.path import along


def test_distances_are_along_the_object():
    angle = np.linspace(0.0, 1.5 * np.pi, 60)  # its ends are near each other
    arc = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    away, length = along(arc)
    np.testing.assert_allclose(length, 0.2 * 1.5 * np.pi, rtol=0.01)  # chords over a few points are shorter
    np.testing.assert_allclose(np.sort(away), 0.2 * angle, rtol=0.02, atol=1e-12)


def test_few_points_are_as_far_as_the_way_from_one_to_the_next():
    """Eight neighbours of nine points are all others: the way would lead straight across the bend."""
    angle = np.linspace(0.0, 1.2 * np.pi, 9)
    arc = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    away, length = along(arc)
    chord = 2 * 0.2 * np.sin(0.5 * angle[1])
    np.testing.assert_allclose(length, 8 * chord)
    np.testing.assert_allclose(np.sort(away), chord * np.arange(9), atol=1e-9)


def test_the_order_of_the_points_does_not_matter():
    rng = np.random.default_rng(2)
    places = np.stack([np.linspace(0, 0.5, 80), 0.02 * rng.normal(size=80), 0.01 * rng.normal(size=80)], -1)
    order = rng.permutation(80)
    np.testing.assert_allclose(along(places[order])[0], along(places)[0][order])
