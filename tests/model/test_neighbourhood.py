"""Graphs of touching points."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from model.neighbourhood import neighbourhood_graph

SPACING = 0.01


def block(*sides, shift=(0.0, 0.0, 0.0)):
    points = np.stack(np.meshgrid(*[np.arange(n) * SPACING for n in sides], indexing="ij"), axis=-1)
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, (*sides, 3)) * SPACING
    return (points + jitter).reshape(-1, 3) + np.array(shift)


def pieces(graph):
    return connected_components(graph, directed=False)[0]


def test_edges_are_symmetric_and_carry_their_length():
    points = block(6, 5, 4)
    graph = neighbourhood_graph(points).tocoo()
    assert (graph != graph.T).nnz == 0
    np.testing.assert_allclose(graph.data, np.linalg.norm(points[graph.row] - points[graph.col], axis=1))


def test_no_edge_jumps_a_gap():
    """An arm beside a body: three spacings apart, joined at one end."""
    body, arm = block(5, 20, 5), block(5, 20, 5, shift=(8 * SPACING, 0, 0))
    bridge = block(4, 2, 5, shift=(4.5 * SPACING, 0, 0))
    points = np.concatenate([body, arm, bridge])
    edges = neighbourhood_graph(points).tocoo()
    crossing = (edges.row < len(body)) & (edges.col >= len(body)) & (edges.col < len(body) + len(arm))
    assert not crossing.any()
    assert pieces(edges) == 1


def test_two_strings_side_by_side_are_joined_once():
    """Three spacings apart: nearer than the tenth neighbour along the string."""
    string = np.arange(30)[:, None] * np.array([[SPACING, 0.0, 0.0]])
    graph = neighbourhood_graph(np.concatenate([string, string + np.array([0.0, 3 * SPACING, 0.0])])).tocoo()
    assert ((graph.row < 30) & (graph.col >= 30)).sum() <= 2


def test_separate_pieces_are_joined_where_they_come_closest():
    left, right = block(4, 4, 4), block(4, 4, 4, shift=(20 * SPACING, 0, 0))
    graph = neighbourhood_graph(np.concatenate([left, right])).tocoo()
    assert pieces(graph) == 1
    crossing = (graph.row < len(left)) & (graph.col >= len(left))
    assert crossing.sum() == 1
    gap = np.linalg.norm(left[:, None] - right[None], axis=-1)
    assert graph.data[crossing][0] == pytest.approx(gap.min())


@pytest.mark.parametrize("seed", range(3))
def test_scattered_points_are_one_piece(seed):
    points = np.random.default_rng(seed).uniform(0, 1, (60, 3)) * np.array([100.0, 1.0, 1.0])
    assert pieces(neighbourhood_graph(points)) == 1


@pytest.mark.parametrize("count", [1, 2, 3])
def test_very_few_points(count):
    graph = neighbourhood_graph(np.arange(3.0 * count).reshape(count, 3))
    assert graph.shape == (count, count)
    assert pieces(graph) == 1


def test_coincident_points_stay_connected():
    points = np.concatenate([np.zeros((20, 3)), np.ones((20, 3))])
    assert pieces(neighbourhood_graph(points)) == 1
