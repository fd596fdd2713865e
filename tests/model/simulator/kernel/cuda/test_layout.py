"""Every edge has its slots, and every slot leads where its edge does."""

import numpy as np
import pytest
import torch

from model.simulator.edges import Edges
from model.simulator.forces.volume import Volume
from model.simulator.kernel.cuda.layout import WARP, lay_out, lay_out_stencils

COUNT, CPU = 75, torch.device("cpu")


@pytest.fixture
def edges():
    rng = np.random.default_rng(4)
    pairs = np.unique(np.sort(rng.integers(0, COUNT, (400, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    held = np.stack([np.repeat([0, 2], 6), rng.permutation(COUNT)[:12]], axis=1)  # controller 1 holds nothing
    return Edges(torch.from_numpy(pairs), torch.from_numpy(held), COUNT, 3)


def slots_of(slots, row):
    """As the engine finds them."""
    first = int(slots.start[row // WARP])
    return [(first + k) * WARP + row % WARP for k in range(int(slots.degree[row]))]


def test_rows_are_a_reordering(edges):
    layout = lay_out(edges, CPU)
    assert torch.equal(layout.row.sort().values, torch.arange(COUNT))
    assert torch.equal(layout.point[layout.row], torch.arange(COUNT))


def test_each_point_has_its_edges(edges):
    layout = lay_out(edges, CPU)
    first, second, springs = edges.first, edges.second, edges.spring_count
    for point, row in enumerate(layout.row.tolist()):
        found = slots_of(layout.springs, row)
        seen = {(int(layout.springs.edge[s]), int(layout.point[layout.springs.other[s]])) for s in found}
        own = [(e, int(second[e])) for e in range(springs) if first[e] == point]
        own += [(e, int(first[e])) for e in range(springs) if second[e] == point]
        assert len(found) == len(own)
        assert seen == set(own)
        held = {(int(layout.held.edge[s]), int(layout.held.other[s])) for s in slots_of(layout.held, row)}
        assert held == {
            (e - springs, int(second[e]) - COUNT) for e in range(springs, len(edges)) if first[e] == point
        }


def test_places_are_the_slots_of_both_ends(edges):
    layout = lay_out(edges, CPU)
    for place in layout.springs.places:
        assert torch.equal(layout.springs.edge[place], torch.arange(edges.spring_count))
    assert not set(layout.springs.places[0].tolist()) & set(layout.springs.places[1].tolist())


def test_controllers_know_their_springs(edges):
    holds = lay_out(edges, CPU).holds
    owner = edges.second[edges.spring_count :] - COUNT
    for controller, springs in enumerate(holds.tolist()):
        found = [spring for spring in springs if spring < len(owner)]
        assert found == torch.nonzero(owner == controller).flatten().tolist()


def test_corners_lead_to_points_and_back(edges):
    rng = np.random.default_rng(5)
    groups = [torch.from_numpy(np.stack([rng.permutation(COUNT)[:4] for _ in range(n)])) for n in (7, 40)]
    forces = tuple(Volume(group, 1.0, torch.ones(len(group))) for group in groups)
    layout, incidence = lay_out(edges, CPU), lay_out_stencils(edges, forces, CPU)
    assert incidence.count == 4 * 47
    corner_points = []
    for group, corners, begin in zip(groups, incidence.corners, incidence.corner_row, strict=True):
        assert torch.equal(layout.point[corners.long()], group.T)
        assert begin == len(corner_points)
        corner_points += group.T.reshape(-1).tolist()
    for point, row in enumerate(layout.row.tolist()):
        found = [int(incidence.points.other[slot]) for slot in slots_of(incidence.points, row)]
        assert sorted(found) == [c for c, corner in enumerate(corner_points) if corner == point]
