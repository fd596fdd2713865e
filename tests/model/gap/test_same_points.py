"""Whether two recordings show the same points."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.same_points import same_points


@pytest.fixture
def bent(hung):
    """The sheet, stretched by a fifth, and turned."""
    points = 1.2 * hung.points[..., [1, 0, 2]]
    return replace(hung, points=points)


def test_points_that_stay_among_their_neighbours_are_the_same(hung, bent):
    assert same_points(hung, bent)
    hidden = bent.points.copy()
    hidden[:, 5:9] = np.nan
    assert same_points(hung, replace(bent, points=hidden))


def test_points_in_another_order_are_others(hung, bent):
    order = np.random.default_rng(0).permutation(hung.points.shape[1])
    assert not same_points(hung, replace(bent, points=bent.points[:, order]))


def test_more_points_are_others(hung, bent):
    assert not same_points(hung, replace(bent, points=bent.points[:, :-1]))


def test_points_of_which_too_few_are_seen_in_both_are_others(hung, bent):
    left, right = hung.points.copy(), bent.points.copy()
    left[:, :30], right[:, 32:] = np.nan, np.nan
    assert not same_points(replace(hung, points=left), replace(bent, points=right))
