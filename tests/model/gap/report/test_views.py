"""Parallel views: true lengths, what is up stays up, both together show all of an object."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from model.gap.report.views import View, bare, neighbours, scale_bar, spread_out, two_views


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (1.0, 0.3), (-2.0, 0.9)])
def test_a_view_is_a_rotation(azimuth, elevation):
    view = View.of(azimuth, elevation)
    axes = np.stack([view.right, view.up, view.towards])
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.isclose(np.linalg.det(axes), 1.0)
    assert view([0.0, 0.0, 1.0] @ np.eye(3))[1] > 0


def test_the_far_ones_come_first():
    view = View.of(0.0, 0.0)
    assert list(view.order(np.array([[1.0, 0, 0], [-1.0, 0, 0], [0.0, 0, 0]]))) == [1, 2, 0]


def test_it_looks_across_the_length(findings):
    for view in two_views(findings.rest):
        width = np.ptp(view(findings.rest)[:, 0])
        assert width > 0.7 * np.ptp(findings.rest[:, 0])


def test_the_views_do_not_depend_on_where_the_object_is_or_how_it_is_turned(findings):
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    moved = findings.rest @ turn.T + [3.0, -1.0, 0.5]
    for view, other in zip(two_views(findings.rest), two_views(moved), strict=True):
        place, elsewhere = view(findings.rest), other(moved)
        assert np.allclose(np.ptp(place, axis=0), np.ptp(elsewhere, axis=0), atol=1e-6)


def test_what_lies_flat_is_seen_from_higher(findings):
    flat = findings.rest[:, [0, 2, 1]]
    assert two_views(flat)[0].towards[2] > two_views(findings.rest)[0].towards[2]


def test_neighbours_of_a_grid_are_its_edges(findings):
    pairs = neighbours(findings.rest)
    length = np.linalg.norm(np.diff(findings.rest[pairs], axis=1)[:, 0], axis=-1)
    assert np.allclose(length, 0.03)
    assert len(pairs) == 10 * 11 + 9 * 12


def test_the_points_that_are_chosen_cover_the_object(findings):
    shuffled = np.random.default_rng(0).permutation(findings.rest)
    chosen = shuffled[spread_out(shuffled, 30)]
    assert len(np.unique(chosen, axis=0)) == 30
    apart = np.linalg.norm(findings.rest[:, None] - chosen[None], axis=-1)
    assert apart.min(1).max() < 2.5 * 0.03
    assert list(spread_out(shuffled, 500)) == list(range(len(shuffled)))


def test_a_single_point_has_no_neighbours():
    assert neighbours(np.zeros((1, 3))).shape == (0, 2)


@pytest.mark.parametrize(("half", "text"), [(0.2, "10 cm"), (0.004, "2 mm"), (5.0, "2 m"), (0.0, "0.5 mm")])
def test_a_scale_has_a_round_length_that_is_true(half, text):
    axes = Figure().subplots()
    bare(axes, np.zeros(2), np.array([half, half]))
    scale_bar(axes)
    left, right = axes.lines[0].get_xdata()
    number, unit = text.split()
    assert axes.texts[0].get_text() == text
    assert np.isclose(right - left, float(number) * {"m": 1.0, "cm": 1e-2, "mm": 1e-3}[unit])
