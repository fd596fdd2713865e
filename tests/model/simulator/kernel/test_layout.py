"""Every edge has its slots, and every thread its share."""

import numpy as np
import pytest
import torch

from model.simulator.edges import Edges
from model.simulator.kernel.layout import LANES, lay_out


@pytest.fixture
def edges(rng):
    """101 points, the last without a spring, one spring twice; two controllers."""
    springs = torch.from_numpy(rng.integers(0, 100, (700, 2)))
    springs = springs[springs[:, 0] != springs[:, 1]]
    return Edges(torch.cat([springs, springs[:1]]), torch.tensor([[0, 3], [1, 3], [1, 90]]), 101, 2)


def test_each_spring_is_seen_from_both_of_its_ends(edges):
    layout = lay_out(edges)
    row = layout.row.numpy()
    for kind, ends in ((layout.springs, 2), (layout.held, 1)):
        places = kind.places.numpy()
        assert places.shape[0] == ends
        assert len(np.unique(places)) == places.size
        slice_of = np.searchsorted(kind.start.numpy(), places // LANES, side="right") - 1
        own = slice_of * LANES + places % LANES
        other = kind.offset.numpy()[places] // LANES
        first = row[edges.first.numpy()][: edges.spring_count]
        second = row[edges.second.numpy()[: edges.spring_count]]
        if ends == 1:
            first = row[edges.first.numpy()[edges.spring_count :]]
            second = edges.second.numpy()[edges.spring_count :] - 101 + layout.slices * LANES
        np.testing.assert_array_equal(own[0], first)
        np.testing.assert_array_equal(other[0], second)
        if ends == 2:
            np.testing.assert_array_equal(own[1], second)
            np.testing.assert_array_equal(other[1], first)
        np.testing.assert_array_equal(
            kind.edge.numpy()[places], np.tile(np.arange(places.shape[1]), (ends, 1))
        )


def test_slots_that_only_fill_up_lead_from_a_point_to_itself(edges):
    layout = lay_out(edges)
    slots = layout.springs
    filling = np.setdiff1d(np.arange(len(slots.offset)), slots.places.numpy())
    slice_of = np.searchsorted(slots.start.numpy(), filling // LANES, side="right") - 1
    np.testing.assert_array_equal(slots.offset.numpy()[filling] // LANES, slice_of * LANES + filling % LANES)


def test_rows_are_a_permutation_of_the_points(edges):
    layout = lay_out(edges)
    assert sorted(layout.row.tolist()) == list(range(101))
    assert layout.point[layout.row].tolist() == list(range(101))


def test_threads_have_about_equal_shares(rng):
    edges = Edges(
        torch.from_numpy(np.stack([np.arange(999), np.arange(1, 1000)], 1)), torch.zeros(0, 2).long(), 1000, 0
    )
    layout = lay_out(edges)
    bounds = [*layout.partition(4).tolist(), layout.slices]
    work = np.diff(layout.springs.start.numpy()[bounds])
    assert bounds[0] == 0
    assert work.sum() == layout.springs.rows
    assert work.max() < 1.1 * work.min()


def test_a_graph_is_laid_out_once(edges):
    assert lay_out(edges) is lay_out(edges)
