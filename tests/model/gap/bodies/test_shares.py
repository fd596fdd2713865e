"""How mass is shared among the points of a body, against bodies that are alike everywhere."""

import numpy as np
import pytest

from model.gap.bodies.neighbours import pairs_within
from model.gap.bodies.shares import shares
from model.gap.bodies.solid import lattice


def gyration(points, share):
    """Root of the mean square distance from the middle along each axis [m]."""
    middle = (share[:, None] * points).sum(0)
    return np.sqrt((share[:, None] * (points - middle) ** 2).sum(0))


def surface(size, spacing):
    """Points on a box, in rows [m]."""
    counts = [round(side / spacing) + 1 for side in size]
    axes = [np.linspace(0, side, count) for side, count in zip(size, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    outside = np.isclose(grid, 0.0) | np.isclose(grid, size)
    return grid[outside.any(1)]


def test_pieces_of_a_rope_weigh_as_much_as_they_are_long():
    places = np.array([0.0, 0.1, 0.2, 0.4, 0.6, 0.7])
    points = np.stack([places, 0 * places, 0 * places], -1)
    springs = np.stack([np.arange(5), np.arange(1, 6)], -1)
    share = shares(points, springs, "rope", 0.1)
    np.testing.assert_allclose(share / share[1], [1.0, 1.0, 1.5, 2.0, 1.5, 1.0])
    assert share.sum() == pytest.approx(1.0)


def test_a_net_is_as_hard_to_turn_as_a_sheet():
    """At its rims points have half as much around them, and at its corners less."""
    column, row = np.meshgrid(np.arange(12), np.arange(11), indexing="ij")
    points = np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row, 0.0 * row], -1).reshape(-1, 3)
    share = shares(points, pairs_within(points, 1.85, 6), "sheet", 1.0)
    assert share.sum() == pytest.approx(1.0)
    inner, rim = (share[(row.ravel() == at) & (column.ravel() == 5)].item() for at in (5, 0))
    assert rim == pytest.approx(0.5 * inner, rel=0.15)
    np.testing.assert_allclose(
        gyration(points, share)[:2], np.ptp(points, axis=0)[:2] / np.sqrt(12), rtol=0.04
    )


@pytest.mark.parametrize("size", [(0.3, 0.2, 0.15), (0.4, 0.1, 0.1), (0.25, 0.25, 0.05)])
def test_a_solid_is_as_hard_to_turn_as_a_box(size):
    """Were all of its points as heavy it would be a fifth harder to turn about its long axis, or more."""
    points, spacing = lattice(surface(np.array(size), 0.025), 1.0)
    share = shares(points, pairs_within(points, 1.8 * spacing, 6), "solid", spacing)
    assert share.sum() == pytest.approx(1.0)
    true = np.array(size) / np.sqrt(12)
    across = np.sqrt((true[1:] ** 2).sum())
    found, even = (
        np.sqrt((gyration(points, each)[1:] ** 2).sum())
        for each in (share, np.full(len(points), 1 / len(points)))
    )
    assert found == pytest.approx(across, rel=0.13)  # but for the least that a point has
    assert even > 1.1 * across


def test_its_middle_is_where_that_of_the_volume_is():
    """Of two blocks that make an L, the one with as much surface and less inside weighs less."""
    places = np.concatenate(
        [surface(np.array([0.3, 0.1, 0.1]), 0.025), surface(np.array([0.1, 0.1, 0.3]), 0.025)]
    )
    apart = (places[:, None] == places[None]).all(-1)
    places = places[np.triu(apart, 1).sum(0) == 0]
    points, spacing = lattice(places, 1.0)
    share = shares(points, pairs_within(points, 1.8 * spacing, 6), "solid", spacing)
    long, tall = 0.2 * 0.01, 0.3 * 0.01
    middle = (long * np.array([0.2, 0.05, 0.05]) + tall * np.array([0.05, 0.05, 0.15])) / (long + tall)
    assert np.linalg.norm((share[:, None] * points).sum(0) - middle) < 0.012


def test_points_in_nothing_have_a_little():
    """A point that no piece reaches has mass all the same; and where there is none all have as much."""
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.0, 0.1, 0], [0.1, 0.1, 0.1]])
    np.testing.assert_allclose(shares(points, pairs_within(points, 1.0, 3), "solid", 0.1), 0.25)


@pytest.mark.parametrize("seed", range(4))
def test_an_irregular_net_weighs_where_it_is(seed):
    """Of markers here and there on a sheet few are in a triangle: those are not all of its mass."""
    rng = np.random.default_rng(seed)
    points = np.stack([*rng.uniform(0.0, 0.3, (2, 30)), np.zeros(30)], -1)
    share = shares(points, pairs_within(points, 0.1, 6), "sheet", 0.05)
    assert np.linalg.norm((share[:, None] * points).sum(0) - [0.15, 0.15, 0.0]) < 0.03
