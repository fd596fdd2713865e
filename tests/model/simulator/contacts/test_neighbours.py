import numpy as np
import pytest
import torch

from model.simulator.contacts.neighbours import SKIN, NeighbourSearch

DISTANCE = 0.05


@pytest.fixture
def rest(rng):
    """Far apart at rest, so that every pair may collide."""
    return torch.from_numpy(rng.uniform(-10, 10, (60, 3)))


def within(positions, search):
    first, second = search.pairs(positions)
    apart = (positions[second] - positions[first]).norm(dim=1)
    return {(int(i), int(j)) for i, j, d in zip(first, second, apart, strict=True) if d < DISTANCE}


def brute(positions):
    apart = torch.cdist(positions, positions).numpy()
    return {(int(i), int(j)) for i, j in np.argwhere(np.triu(apart < DISTANCE, 1))}


def test_misses_no_pair_while_everything_moves(rest, rng):
    search = NeighbourSearch(rest, torch.zeros((0, 2), dtype=torch.long), DISTANCE)
    places = torch.from_numpy(rng.uniform(0, 0.2, (60, 3)))
    seen = 0
    for _ in range(200):
        places = places + torch.from_numpy(rng.normal(0, 0.1 * SKIN * DISTANCE, (60, 3)))
        found = within(places, search)
        assert found == brute(places)
        seen += len(found)
    assert seen > 1000
    assert 5 < search.searches < 100


def test_a_common_motion_needs_no_new_search(rest, rng):
    search = NeighbourSearch(rest, torch.zeros((0, 2), dtype=torch.long), DISTANCE)
    places = torch.from_numpy(rng.uniform(0, 0.2, (60, 3)))
    for step in range(50):
        moved = places + step * torch.tensor([0.1, -0.2, 0.3])
        assert within(moved, search) == brute(moved)
    assert search.searches == 1


def test_joined_and_close_at_rest_are_excluded():
    rest = torch.tensor([[0.0, 0, 0], [0.04, 0, 0], [1.0, 0, 0], [2.0, 0, 0]], dtype=torch.float64)
    search = NeighbourSearch(rest, torch.tensor([[3, 0]]), DISTANCE)
    first, second = search.pairs(torch.zeros((4, 3), dtype=torch.float64))
    # (0, 1) close at rest, (0, 3) joined; all the others may touch
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(0, 2), (1, 2), (1, 3), (2, 3)]


def test_lost_numbers_find_nothing(rest):
    search = NeighbourSearch(rest, torch.zeros((0, 2), dtype=torch.long), DISTANCE)
    assert len(search.pairs(torch.full((60, 3), float("nan")))[0]) == 0
    assert len(search.pairs(torch.zeros((60, 3)))[0]) == 60 * 59 // 2
