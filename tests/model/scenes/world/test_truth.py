import numpy as np
import pytest

from model.predictor.lattice import lattice_stiffness
from model.scenes.world.body import Block, Solid
from model.scenes.world.materials import Substance
from model.scenes.world.truth import (
    GIVING,
    SUBSTEPS,
    UNEVEN,
    Grip,
    affordable,
    fine_graph,
    hold,
    make_world,
    part_volumes,
    run_world,
)

FOAM = Substance(0, 2e4, 0.1, 0.4, 0.5, 0.2, 120.0)
HEAVY = Substance(1, 4e4, 0.2, 0.1, 0.5, 0.2, 480.0)
GRAVITY = (0.0, 0.0, -9.81)


@pytest.fixture(scope="module")
def block():
    """Half light, half heavy."""
    pieces = [
        Block((-0.04, 0.0, 0.03), (0.045, 0.03, 0.03), 0.0),
        Block((0.045, 0.0, 0.03), (0.04, 0.03, 0.03), 0.0),
    ]
    body = Solid(pieces, [0, 1])
    return body, fine_graph(body, (FOAM, HEAVY), "solid", 500, np.random.default_rng(0))


@pytest.fixture(scope="module")
def world(block):
    modulus = np.array([2e4, 4e4])
    return make_world(block[1], (FOAM, HEAVY), "solid", modulus, 2e-4, 0.5, 0.2, np.random.default_rng(1))


def test_the_graph_weighs_what_its_parts_weigh(block):
    body, graph = block
    volume = part_volumes(graph, np.array([FOAM.density, HEAVY.density]))
    assert volume.sum() == pytest.approx(body.volume(), rel=0.05)
    assert volume[0] / volume.sum() == pytest.approx(0.5, abs=0.08)
    degree = np.bincount(graph.springs.ravel(), minlength=len(graph.points))
    assert degree.min() >= 4


def test_springs_are_those_of_the_lattice_and_borders_take_the_mean_of_logarithms(block):
    graph, modulus = block[1], np.array([1e3, 1e5])
    volume = part_volumes(graph, np.array([FOAM.density, HEAVY.density]))
    found = lattice_stiffness(graph, modulus, volume, "solid")
    unit = lattice_stiffness(graph, np.ones(2), volume, "solid")
    ends = graph.part[graph.springs]
    np.testing.assert_allclose(found[(ends == 0).all(axis=1)], 1e3 * unit[(ends == 0).all(axis=1)])
    border = ends[:, 0] != ends[:, 1]
    assert border.any()
    np.testing.assert_allclose(found[border], 1e4 * unit[border])


def test_only_what_is_too_stiff_is_softened(block):
    graph, density = block[1], np.array([FOAM.density, HEAVY.density])
    soft = np.array([2e3, 3e3])
    np.testing.assert_allclose(affordable(graph, soft, density, "solid"), soft)
    mixed = affordable(graph, np.array([2e3, 5e8]), density, "solid")
    assert mixed[0] == pytest.approx(2e3)
    assert 1e5 < mixed[1] < 5e8


def test_the_modulus_varies_smoothly_within_a_part_but_not_on_average(block, world):
    graph = block[1]
    volume = part_volumes(graph, np.array([FOAM.density, HEAVY.density]))
    logs = np.log(world.stiffness / GIVING / lattice_stiffness(graph, world.modulus, volume, "solid"))
    assert 0.4 * UNEVEN < logs.std() < 1.2 * UNEVEN
    for part in range(2):
        own = (graph.part[graph.springs] == part).all(axis=1)
        assert abs(logs[own].mean()) < 0.03


def test_dashpots_share_the_viscosity_and_differ_by_the_damping_of_their_part(block, world):
    graph = block[1]
    ends = graph.part[graph.springs]
    own = [np.median(world.dashpot[(ends == part).all(axis=1)]) for part in range(2)]
    assert own[1] / own[0] == pytest.approx(HEAVY.damping / FOAM.damping)
    total = (world.dashpot * graph.rest_length.astype(np.float64) ** 2).sum()
    assert total == pytest.approx(2e-4, rel=0.15)


def test_hands_hold_the_world_where_and_as_firmly_as_the_twin(block, world):
    graph = block[1]
    twin = graph.points[::3]
    corner = twin[np.argmax(twin @ [1.0, 0.2, 1.0])]
    fingers = (corner + np.array([[0.0, 0.0, 0.01], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]])).astype(np.float32)
    pairs, lengths = hold(twin, fingers, 6)
    assert (np.bincount(pairs[:, 0]) <= 6).all()
    gaps = np.linalg.norm(twin[pairs[:, 1]] - fingers[pairs[:, 0]], axis=1)
    np.testing.assert_allclose(lengths, gaps, rtol=1e-5)
    grip = Grip(pairs, np.full(len(pairs), 300.0), 0.05, twin)
    times = np.arange(24) / 30.0
    way = np.minimum(times / 0.4, 1.0) * 0.15
    motion = (fingers[None] + np.outer(way, [0.0, 0.0, 1.0])[:, None]).astype(np.float32)
    moved = run_world(world, np.eye(3), np.zeros(3), motion, grip, times, GRAVITY)
    near = np.linalg.norm(graph.points - corner, axis=1) < 0.015
    risen = (moved[-1] - moved[0])[near, 2].mean()
    assert risen == pytest.approx(0.15, abs=0.03)
    assert moved[..., 2].min() > -1e-3


def test_the_world_is_still_without_weight_and_falls_with_it(world):
    times = np.arange(5) / 30.0
    nothing = np.zeros((5, 0, 3), np.float32)
    grip = Grip(np.zeros((0, 2), np.int32), np.zeros(0), 0.0, world.topology.points)
    up = np.array([0.0, 0.0, 0.5])
    still = run_world(world, np.eye(3), up, nothing, grip, times, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(still[-1], still[0], atol=1e-6)
    falling = run_world(world, np.eye(3), up, nothing, grip, times, GRAVITY)
    drop = (falling[0] - falling[-1])[:, 2].mean()
    assert drop == pytest.approx(0.5 * 9.81 * times[-1] ** 2, rel=0.05)
    assert SUBSTEPS < 250
