"""Tensions at rest, against statics."""

import numpy as np
import pytest

from model.gap.prestress import RELUCTANCE, resting


def missing(points, springs, weights, rest):
    """What is not balanced at each point [N], and along which way each spring pulls."""
    force = weights + rest.supports
    way = points[springs[:, 1]] - points[springs[:, 0]]
    axis = way / np.linalg.norm(way, axis=1, keepdims=True)
    np.add.at(force, springs[:, 0], rest.tensions[:, None] * axis)
    np.add.at(force, springs[:, 1], -rest.tensions[:, None] * axis)
    return force, axis


def test_a_hanging_chain_bears_what_is_below():
    points = np.stack([np.zeros(6), np.zeros(6), -0.1 * np.arange(6)], -1)
    springs = np.stack([np.arange(5), np.arange(1, 6)], -1)
    weights = np.tile([0.0, 0.0, -2.0], (6, 1))
    borne = np.arange(6) == 0
    tensions = resting(points, springs, weights, borne.astype(float)).tensions
    np.testing.assert_allclose(tensions, 2.0 * np.array([5, 4, 3, 2, 1]), rtol=0.02)


def test_balances_every_point_that_nothing_bears():
    rng = np.random.default_rng(2)
    points = rng.uniform(0, 0.2, (30, 3))
    springs = np.argwhere(np.triu(np.ones((30, 30)), 1))
    weights = np.tile([0.0, 0.0, -1.0], (30, 1))
    borne = np.arange(30) < 3
    rest = resting(points, springs, weights, borne.astype(float))
    force, _ = missing(points, springs, weights, rest)
    assert not rest.supports[~borne].any()
    assert np.abs(force[~borne]).max() < 0.02
    assert np.abs(force[borne]).max() < 0.02


def test_the_firmer_of_two_hands_bears_more():
    points = np.stack([0.1 * np.arange(3), np.zeros(3), np.zeros(3)], -1)
    weights = np.tile([0.0, 0.0, -1.0], (3, 1))
    springs = np.array([[0, 1], [1, 2]])
    rest = resting(
        points + np.array([[0, 0, 0.1], [0, 0, 0], [0, 0, 0.1]]), springs, weights, np.array([1.0, 0.0, 0.3])
    )
    assert rest.supports[0, 2] > rest.supports[2, 2] > 0.0


def wavy_sheet():
    """A sheet whose upper edge is held, its springs in some order, and its weight."""
    rng = np.random.default_rng(1)
    u, v = np.meshgrid(np.linspace(0.0, 0.3, 9), np.linspace(0.0, 0.2, 7))
    sheet = np.stack([u.ravel(), 0.02 * np.sin(20.0 * u.ravel()), -v.ravel()], -1)
    sheet += rng.normal(0.0, 1e-3, sheet.shape)
    apart = np.linalg.norm(sheet[:, None] - sheet, axis=-1)
    springs = rng.permutation(np.argwhere(np.triu(apart < 0.06, 1)))
    held = np.where(np.arange(len(sheet)) % 9 == 0, 1.0, 0.0)
    return sheet, springs, np.tile([0.0, 0.0, -0.03], (len(sheet), 1)), held


@pytest.mark.parametrize("pressing", [0.5, 0.05])
def test_springs_bear_what_they_do_as_those_that_are_softer_where_they_press(pressing):
    """However far away and in whatever order: by the moves of points against them, at the least energy."""
    sheet, springs, weights, held = wavy_sheet()
    found = resting(sheet, springs, weights, held, pressing=pressing)
    far = resting(sheet + np.array([3.0, -2.0, 7.0]), springs, weights, held, pressing=pressing)
    order = np.random.default_rng(2).permutation(len(springs))
    other = resting(sheet, springs[order], weights, held, pressing=pressing)
    np.testing.assert_allclose(far.tensions, found.tensions, atol=1e-9)
    np.testing.assert_allclose(other.tensions, found.tensions[order], atol=1e-9)
    force, axis = missing(sheet, springs, weights, found)
    # points move by what is not balanced over how reluctant they are
    longer = ((force[springs[:, 1]] - force[springs[:, 0]]) * axis).sum(1) / RELUCTANCE**2
    presses = longer < 0.0
    assert 0.05 < presses.mean() < 0.95
    np.testing.assert_allclose(found.tensions, np.where(presses, pressing, 1.0) * longer, atol=1e-9)


def test_the_softer_springs_are_against_compression_the_less_of_it_they_are_asked_to_bear():
    sheet, springs, weights, held = wavy_sheet()
    pressed = []
    for pressing in (1.0, 0.3, 0.05):
        found = resting(sheet, springs, weights, held, pressing=pressing)
        pressed.append(-found.tensions.clip(max=0.0).sum())
    assert pressed[0] > 1.2 * pressed[1] > 1.2 * 1.2 * pressed[2]


@pytest.mark.parametrize("pressing", [1.0, 0.05])
def test_more_weight_is_borne_as_if_it_had_been_there(pressing):
    """What a load adds is linear as long as no other springs press."""
    rng = np.random.default_rng(4)
    points = np.stack([*np.meshgrid(0.1 * np.arange(4), 0.1 * np.arange(5), indexing="ij")], -1).reshape(
        -1, 2
    )
    points = np.stack([points[:, 0], 0.01 * rng.normal(size=20), -points[:, 1]], -1)
    springs = np.argwhere(np.triu(np.linalg.norm(points[:, None] - points[None], axis=-1) < 0.15, 1))
    weights = np.tile([0.0, 0.0, -1.0], (20, 1))
    bearing = (points[:, 2] > -0.01).astype(float)
    loads = np.zeros((2, 20, 3))
    loads[:, :, 2] = -0.01 * rng.uniform(0.5, 1.0, (2, 20))
    rest = resting(points, springs, weights, bearing, pressing=pressing)
    tensions, supports = rest.more(loads)
    for load, pulls, borne in zip(loads, tensions, supports, strict=True):
        heavier = resting(points, springs, weights + load, bearing, pressing=pressing)
        scale = np.abs(heavier.tensions - rest.tensions).max()
        np.testing.assert_allclose(rest.tensions + pulls, heavier.tensions, atol=0.02 * scale)
        np.testing.assert_allclose(rest.supports + borne, heavier.supports, atol=0.02 * scale)


def test_a_chain_bears_a_load_that_is_hung_on_it():
    """Every piece above it, and none below."""
    points = np.stack([np.zeros(6), np.zeros(6), -0.1 * np.arange(6)], -1)
    springs = np.stack([np.arange(5), np.arange(1, 6)], -1)
    load = np.zeros((1, 6, 3))
    load[0, 3, 2] = -7.0
    rest = resting(points, springs, np.tile([0.0, 0.0, -2.0], (6, 1)), (np.arange(6) == 0).astype(float))
    tensions, supports = rest.more(load)
    np.testing.assert_allclose(tensions[0], [7.0, 7.0, 7.0, 0.0, 0.0], atol=0.15)
    np.testing.assert_allclose(supports[0, 0], [0.0, 0.0, 7.0], atol=0.15)
