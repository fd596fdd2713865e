from dataclasses import replace

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.errors import InputError
from model.exports.coarse_graph import coarse_mass, coarse_springs, match_stiffness, scatter
from model.exports.coarsen import coarsen
from model.exports.mechanics import roll
from model.schema import EffectRecord


@pytest.fixture
def fine(bench):
    return bench("procedural").sheet(size=11)


@pytest.fixture
def block(bench):
    return bench("procedural").solid(size=6)


@pytest.mark.parametrize("which", ["fine", "block"])
def test_mass_and_its_moments_are_kept(which, request):
    twin = request.getfixturevalue(which)
    topology = twin.topology
    kept, owner = scatter(topology, 40)
    mass = coarse_mass(topology, kept, owner).astype(float)
    whole, places = topology.mass.astype(float), topology.points.astype(float)
    assert len(kept) == 40
    assert mass.min() > 0
    np.testing.assert_allclose(mass.sum(), whole.sum(), rtol=1e-6)
    np.testing.assert_allclose(mass @ places[kept], whole @ places, rtol=1e-5, atol=1e-8)
    second = np.einsum("n,ni,nj->ij", whole, places, places)
    np.testing.assert_allclose(np.einsum("n,ni,nj->ij", mass, places[kept], places[kept]), second, rtol=0.01)


@pytest.mark.parametrize("which", ["fine", "block"])
def test_affine_deformations_have_the_energy_that_they_had(which, request):
    twin = request.getfixturevalue(which)
    topology, stiffness = twin.topology, twin.parameters.stiffness
    kept, owner = scatter(topology, 40)
    springs = coarse_springs(topology, kept, owner)
    found = match_stiffness(topology, stiffness, kept, owner, springs)
    assert (found > 0).all()

    def energy(places, pairs, strength, strain):
        apart = places[pairs[:, 1]] - places[pairs[:, 0]]
        stretch = np.einsum("ei,ij,ej->e", apart, strain, apart) / np.linalg.norm(apart, axis=1)
        return 0.5 * float(strength @ stretch**2)

    places, rng = topology.points.astype(float), np.random.default_rng(2)
    for _ in range(6):
        strain = rng.normal(size=(3, 3))
        strain = strain + strain.T
        if which == "fine":
            strain[2] = strain[:, 2] = 0  # a sheet has no springs across
        whole = energy(places, topology.springs, stiffness, strain)
        assert energy(places[kept], springs, found, strain) == pytest.approx(whole, rel=0.06)


def test_the_smaller_twin_moves_as_the_whole_one_and_says_by_how_much_not(fine, tmp_path):
    coarse = coarsen(fine, 45)
    twin = coarse.twin
    away = np.linalg.norm(roll(twin).points - roll(fine).points[:, coarse.kept], axis=-1)
    assert coarse.deviation["mean_m"] == pytest.approx(away.mean())
    assert coarse.deviation["max_m"] == pytest.approx(away.max())
    assert away.mean() < 0.03 * coarse.deviation["travel_m"]
    assert len(twin.topology.springs) < 0.6 * len(fine.topology.springs)
    assert f"{1e3 * away.max():.2g} mm" in coarse.statement
    assert coarse.statement in twin.manifest.warnings
    twin.save(tmp_path / "coarse.twin.zip")
    assert len(TwinBundle.load(tmp_path / "coarse.twin.zip").topology.points) == 45


def test_held_points_stay_held_by_the_same_hands(block):
    small = coarsen(block, 60).twin.topology
    assert set(small.controller_springs[:, 0]) == set(block.topology.controller_springs[:, 0])
    apart = (
        small.controller_points[small.controller_springs[:, 0]] - small.points[small.controller_springs[:, 1]]
    )
    assert np.linalg.norm(apart, axis=1).max() < 0.05


@pytest.mark.parametrize("count", [4, 121, 500])
def test_a_count_that_is_no_reduction_is_refused(fine, count):
    with pytest.raises(InputError, match="give 8 to 120"):
        coarsen(fine, count)


def test_a_twin_that_does_not_move_stays_as_stiff(fine):
    still = replace(fine, controls=fine.controls[:1])
    assert coarsen(still, 40).deviation["stiffness_factor"] == 1.0


def test_effects_belong_to_the_points_of_the_whole_twin(fine):
    with pytest.raises(InputError, match="belongs to the points"):
        coarsen(replace(fine, effects=(EffectRecord(name="wind"),)), 40)


@pytest.fixture
def torn(block):
    """The block in two, and four points that nothing joins: six pieces."""
    topology, stiffness = block.topology, block.parameters.stiffness
    side = np.arange(len(topology.points)) < len(topology.points) // 2
    loose = np.arange(len(topology.points)) >= len(topology.points) - 4
    whole = (side[topology.springs[:, 0]] == side[topology.springs[:, 1]]) & ~loose[topology.springs].any(1)
    left = replace(topology, springs=topology.springs[whole], rest_length=topology.rest_length[whole])
    return replace(block, topology=left, parameters=replace(block.parameters, stiffness=stiffness[whole]))


def test_every_piece_keeps_a_point(torn):
    assert len(coarsen(torn, 30).twin.topology.points) == 30


def test_fewer_points_than_pieces_are_refused(torn):
    with pytest.raises(InputError, match="--points 6: this twin is in 6 pieces: give more points than that"):
        scatter(torn.topology, 6)


def test_a_twin_without_springs_is_refused(block):
    bare = replace(block.topology, springs=block.topology.springs[:0], rest_length=np.zeros(0, np.float32))
    soft = replace(block.parameters, stiffness=np.zeros(0, np.float32))
    with pytest.raises(InputError, match="--points 20: this twin has no springs to make fewer of"):
        coarsen(replace(block, topology=bare, parameters=soft), 20)
