from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.baselines.wiring import Wires, Wiring, hold
from model.spring_graph import local_spacing


def _rule(neighbours, reach, grips=4, grip_reach=2.0):
    return Wiring(np.asarray(neighbours, float), np.asarray(reach, float), grips, grip_reach)


def test_springs_are_as_long_and_as_many_as_the_rule_says(make_case):
    topology = make_case(frames=3).topology
    wires = Wires(topology, np.zeros(len(topology.points), int))
    few, many = (wires.rewire(_rule([count], [2.0])) for count in (6, 20))
    assert len(few.springs) < len(many.springs)
    spacing = local_spacing(topology.points.astype(np.float64))
    assert (many.rest_length <= 2.0 * spacing[many.springs].max(axis=1) + 1e-6).all()
    ends = topology.points[many.springs]
    assert np.allclose(many.rest_length, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))
    assert len(np.unique(np.sort(many.springs, axis=1), axis=0)) == len(many.springs)


def test_each_region_has_its_own_rule(make_case):
    topology = make_case(frames=3).topology
    region = topology.part.astype(int)
    made = Wires(topology, region).rewire(_rule([3, 20], [2.0, 2.0]))
    inner = [(topology.part[made.springs] == part).all(axis=1).sum() for part in (0, 1)]
    assert inner[1] > 2 * inner[0]


def test_a_rule_that_leaves_pieces_keeps_what_joins_them(make_case):
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    topology = make_case(frames=3).topology
    made = Wires(topology, np.zeros(len(topology.points), int)).rewire(_rule([1], [1.0]))
    count = len(topology.points)
    graph = coo_matrix((np.ones(len(made.springs)), made.springs.T), shape=(count, count))
    assert connected_components(graph, directed=False)[0] == 1


@pytest.mark.parametrize("reach", [0.1, 3.0])
def test_each_controller_holds_something_but_no_more_than_asked(make_case, reach):
    topology = make_case(frames=3).topology
    held = hold(topology, 2, reach)
    per_controller = np.bincount(held.controller_springs[:, 0], minlength=len(held.controller_points))
    assert per_controller.min() >= 1
    assert per_controller.max() <= 2


def test_a_controller_that_does_not_touch_the_object_holds_nothing(make_case):
    topology = make_case(frames=3).topology
    loose = topology.controller_springs[:, 0] == 0
    apart = topology.controller_points.copy()
    apart[0] += 1.0
    without = replace(
        topology,
        controller_points=apart,
        controller_springs=topology.controller_springs[~loose],
        controller_rest_length=topology.controller_rest_length[~loose],
    )
    held = hold(without, 4, 2.0)
    assert set(held.controller_springs[:, 0]) == set(range(1, len(apart)))
