from dataclasses import replace

import numpy as np
import pytest

from model.predictor.geometry import (
    EDGE_FEATURES,
    GRIP_FEATURES,
    PART_FEATURES,
    SCENE_FEATURES,
    describe_geometry,
)
from model.predictor.lattice import lattice_stiffness, sprung

LENGTH, STEEP, HEIGHT, DEGREE, DEPTH, TO_GRIP, BORDER, UNIT = 0, 1, 3, 4, 8, 12, 14, 15


@pytest.fixture(scope="module")
def topology(make_case):
    topology = make_case(frames=3).topology
    mass = topology.mass * np.linspace(0.7, 1.3, len(topology.mass), dtype=np.float32)
    return replace(topology, mass=mass)


@pytest.fixture(scope="module")
def geometry(topology):
    return describe_geometry(topology, 2, "solid", 0.0)


def test_it_has_the_columns_it_declares_and_all_are_of_order_one(topology, geometry):
    assert geometry.edges.shape == (len(topology.springs), EDGE_FEATURES)
    assert geometry.parts.shape == (2, PART_FEATURES)
    assert geometry.scene.shape == (SCENE_FEATURES,)
    assert geometry.grips.shape == (len(topology.controller_springs), GRIP_FEATURES)
    for values in (geometry.edges, geometry.parts, geometry.scene, geometry.grips):
        assert np.isfinite(values).all()
        assert np.abs(values).max() < 5.0
    assert (np.ptp(geometry.edges, axis=0) > 0.02).all()  # no column is idle


def test_columns_mean_what_they_say(topology, geometry):
    offset = topology.points[topology.springs[:, 1]] - topology.points[topology.springs[:, 0]]
    upright = np.abs(offset[:, 2]) / np.linalg.norm(offset, axis=1)
    np.testing.assert_allclose(geometry.edges[:, STEEP], upright, atol=1e-5)
    ends = topology.part[topology.springs]
    own = (ends == 0).all(axis=1)
    order = np.argsort(topology.rest_length[own], kind="stable")
    assert (np.diff(geometry.edges[own][order, LENGTH]) >= -1e-6).all()
    np.testing.assert_array_equal(geometry.edges[:, BORDER] == 1.0, ends[:, 0] != ends[:, 1])
    middle = topology.points[topology.springs].mean(axis=1)
    assert np.corrcoef(geometry.edges[:, HEIGHT], middle[:, 2])[0, 1] > 0.999
    assert np.corrcoef(geometry.edges[:, TO_GRIP], middle[:, 0])[0, 1] > 0.9  # held at x = 0
    core = topology.points[:, 1:] - np.median(topology.points[:, 1:], axis=0)
    inside = (np.linalg.norm(core, axis=1) < 0.01)[topology.springs].all(axis=1)
    assert geometry.edges[inside, DEPTH].mean() < 0.7 * geometry.edges[~inside, DEPTH].mean()


def test_scale_shows_in_size_alone(topology, geometry):
    twice = replace(
        topology,
        points=2 * topology.points,
        rest_length=2 * topology.rest_length,
        controller_points=2 * topology.controller_points,
        controller_rest_length=2 * topology.controller_rest_length,
    )
    found = describe_geometry(twice, 2, "solid", 0.0)
    assert found.size == pytest.approx(2 * geometry.size, rel=1e-5)
    np.testing.assert_allclose(found.edges, geometry.edges, atol=1e-4)
    np.testing.assert_allclose(found.parts[:, :-2], geometry.parts[:, :-2], atol=1e-4)
    np.testing.assert_allclose(found.scene[0] - geometry.scene[0], np.log(2), atol=1e-4)


def test_how_densely_a_part_was_sprung_does_not_show(topology):
    """A topology is built for what a material was thought to be: a belief that changed must not return."""
    rng = np.random.default_rng(0)
    first = (topology.part[topology.springs] == 1).all(axis=1)
    kept = ~first | (rng.random(len(first)) < 0.6)  # the second part asks for fewer springs
    thinner = replace(topology, springs=topology.springs[kept], rest_length=topology.rest_length[kept])
    before, after = (describe_geometry(each, 2, "solid", 0.0) for each in (topology, thinner))
    inner = (topology.part[thinner.springs] == 1).all(axis=1)
    columns = [LENGTH, DEGREE, UNIT]
    apart = after.edges[inner][:, columns].mean(axis=0) - before.edges[first][:, columns].mean(axis=0)
    assert np.abs(apart).max() < 0.06
    np.testing.assert_allclose(after.scene, before.scene, atol=1e-6)
    np.testing.assert_allclose(after.parts[:, :-1], before.parts[:, :-1], atol=1e-6)


def test_shares_are_the_stiffness_of_the_lattice(topology, geometry):
    modulus, volume = np.array([3e3, 7e4]), np.array([2e-4, 5e-4])
    expected = lattice_stiffness(topology, modulus, volume, "solid")
    found = sprung(geometry.shares, np.log(modulus), volume, topology.part[topology.springs])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_ground_and_the_shape_class_are_told(topology, geometry):
    rope = describe_geometry(topology, 2, "rope", None)
    assert geometry.scene[4:7].tolist() == [0.0, 0.0, 1.0]
    assert rope.scene[4:7].tolist() == [0.0, 1.0, 0.0]
    assert geometry.scene[9] == 1.0
    assert rope.scene[9] == rope.scene[10] == 0.0
    assert (rope.parts[:, -2] == 0.0).all()
    assert (geometry.parts[:, -2] > 0.0).all()


def test_two_points_on_a_spring_and_a_label_of_nobody():
    from model.types import Topology

    pair = Topology(
        points=np.float32([[0, 0, 0], [0, 0, 0.1]]),
        mass=np.float32([0.1, 0.1]),
        springs=np.int32([[0, 1]]),
        rest_length=np.float32([0.1]),
        part=np.int32([0, 1]),
        binding_index=np.zeros((0, 1), np.int32),
        binding_weight=np.zeros((0, 1), np.float32),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    found = describe_geometry(pair, 3, "solid", None)
    assert np.isfinite(found.edges).all()
    assert np.isfinite(found.parts).all()
    assert (found.parts[2] == 0.0).all()
