"""Every edge has its slots, and every thread its share."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from model.simulator.edges import Edges
from model.simulator.kernel import layout as layout_module
from model.simulator.kernel.arrange import STRETCH, levelled, owners
from model.simulator.kernel.layout import LANES, cut, lay_out


@pytest.fixture
def edges(rng):
    """101 points, the last without a spring, one spring twice; two controllers."""
    springs = torch.from_numpy(rng.integers(0, 100, (700, 2)))
    springs = springs[springs[:, 0] != springs[:, 1]]
    return Edges(torch.cat([springs, springs[:1]]), torch.tensor([[0, 3], [1, 3], [1, 90]]), 101, 2)


def test_each_edge_has_a_slot_at_one_of_its_points(edges):
    layout = lay_out(edges)
    row, springs = layout.row.numpy(), edges.spring_count
    hands = edges.second.numpy()[springs:] - 101 + layout.slices * LANES
    ends = {
        "springs": np.stack([row[edges.first.numpy()[:springs]], row[edges.second.numpy()[:springs]]]),
        "held": np.stack([row[edges.first.numpy()[springs:]], hands]),
    }
    for kind, expected in ends.items():
        slots = getattr(layout, kind)
        place = slots.place.numpy()
        assert len(np.unique(place)) == len(place)
        slice_of = np.searchsorted(slots.start.numpy(), place // LANES, side="right") - 1
        own, other = slice_of * LANES + place % LANES, slots.offset.numpy()[place] // LANES
        np.testing.assert_array_equal(np.sort([own, other], 0), np.sort(expected, 0))
        np.testing.assert_array_equal(slots.edge.numpy()[place], np.arange(len(place)))
        if kind == "held":
            np.testing.assert_array_equal(own, expected[0])


def test_neighbours_have_about_equally_many_slots(rng):
    pairs = np.sort(rng.integers(0, 40, (2000, 2)), 1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0).T
    owned = np.bincount(pairs[owners(pairs, 40), np.arange(pairs.shape[1])], minlength=40)
    assert owned.sum() == pairs.shape[1]
    assert owned.max() - owned.min() <= 3


def test_points_move_only_within_their_stretch_to_lie_beside_such_as_own_equally_many(rng):
    order, owned = rng.permutation(3 * STRETCH - 5), rng.integers(0, 20, 3 * STRETCH - 5)
    found = levelled(order, owned)
    for begin in range(0, len(order), STRETCH):
        stretch = slice(begin, begin + STRETCH)
        assert set(found[stretch]) == set(order[stretch])
        assert (np.diff(owned[found[stretch]]) >= 0).all()


def test_few_slots_only_fill_up(rng):
    joined = torch.from_numpy(rng.integers(0, 400, (4000, 2)))
    joined = joined[joined[:, 0] != joined[:, 1]]
    slots = lay_out(Edges(joined, torch.zeros(0, 2).long(), 400, 0)).springs
    assert len(joined) / len(slots.offset) > 0.95


def test_slots_that_only_fill_up_lead_from_a_point_to_itself(edges):
    layout = lay_out(edges)
    slots = layout.springs
    filling = np.setdiff1d(np.arange(len(slots.offset)), slots.place.numpy())
    slice_of = np.searchsorted(slots.start.numpy(), filling // LANES, side="right") - 1
    np.testing.assert_array_equal(slots.offset.numpy()[filling] // LANES, slice_of * LANES + filling % LANES)


def test_rows_are_a_permutation_of_the_points(edges):
    layout = lay_out(edges)
    assert sorted(layout.row.tolist()) == list(range(101))
    assert layout.point[layout.row].tolist() == list(range(101))


def test_pieces_are_about_equal_and_have_room_for_all_that_they_join(edges, monkeypatch):
    monkeypatch.setattr(layout_module, "PIECE", 5)
    layout, pieces = lay_out(edges), cut(edges)
    start, reach = pieces.start.tolist(), pieces.reach.tolist()
    work = np.diff(layout.springs.start.numpy()[start])
    assert len(work) > 2
    assert (start[0], start[-1]) == (0, layout.slices)
    assert work.max() < 2 * work.min()
    used = []
    for (begin, end), (low, high), origin in zip(pairwise(start), reach, pieces.origin.tolist(), strict=True):
        rows = slice(int(layout.springs.start[begin]) * LANES, int(layout.springs.start[end]) * LANES)
        seen = layout.springs.offset[rows] // LANES**2
        assert low <= min(begin, int(seen.min()))
        assert max(end, int(seen.max()) + 1) <= high
        used += range(origin + low, origin + high)
    assert used == list(range(pieces.room))


def test_a_graph_is_laid_out_once_however_often_it_is_made(edges):
    springs = torch.stack([edges.first, edges.second], 1)[: edges.spring_count]
    held = torch.tensor([[0, 3], [1, 3], [1, 90]])
    assert lay_out(Edges(springs, held, 101, 2)) is lay_out(edges)
    assert lay_out(Edges(springs.flip(1), held, 101, 2)) is not lay_out(edges)
    assert lay_out(Edges(springs, held, 101, 3)) is not lay_out(edges)
