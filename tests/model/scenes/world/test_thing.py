from dataclasses import replace

import numpy as np
import pytest

from model.priors.materials import MATERIALS
from model.scenes.world import thing as module
from model.scenes.world.thing import BEARING, FEWEST, draw_thing


@pytest.fixture(scope="module", params=["mixed", "cloth", "rope"])
def thing(request):
    return draw_thing("one", request.param, np.random.default_rng(8))


def test_twin_and_world_have_one_mass_and_the_world_is_finer(thing):
    twin, world = thing.topology, thing.world.topology
    assert twin.mass.sum() == pytest.approx(world.mass.sum(), rel=0.06)
    assert 1.4 * len(twin.points) < len(world.points) < 3.4 * len(twin.points)
    assert np.bincount(twin.part).min() >= FEWEST
    assert twin.part.max() == world.part.max() == len(thing.substances) - 1


def test_gaussians_fill_the_body_and_the_density_is_known(thing):
    assert thing.gaussians.volumes.sum() == pytest.approx(thing.shape.body.volume(), rel=1e-3)
    for prior, substance in zip(thing.priors, thing.substances, strict=True):
        assert prior.properties["density"].mean == substance.density
        assert prior.distribution.argmax() == substance.material


def test_the_truth_is_what_was_drawn_or_softer(thing):
    drawn = np.array([one.stiffness for one in thing.substances])
    assert (thing.truth.modulus <= drawn * 1.0001).all()
    assert thing.truth.dashpot_damping > 0.0
    assert 0.0 < thing.truth.restitution < 1.0


def test_no_part_of_a_solid_is_too_soft_for_its_weight():
    for seed in range(3):
        thing = draw_thing("one", "mixed", np.random.default_rng(seed))
        pressure = 9.81 * thing.topology.mass.sum() / thing.shape.body.volume() ** (2 / 3)
        assert thing.truth.modulus.min() > 0.9 * BEARING * pressure


@pytest.mark.parametrize("kind", ["cloth", "rope"])
def test_how_a_twin_is_joined_tells_nothing_of_what_it_is_made_of(kind, monkeypatch):
    def of(material, stiffness):
        def drawn(*arguments):
            substances = draw_substances(*arguments)
            return tuple(replace(one, material=material, stiffness=stiffness) for one in substances)

        monkeypatch.setattr(module, "draw_substances", drawn)
        return draw_thing("one", kind, np.random.default_rng(5))

    draw_substances = module.draw_substances
    soft, hard = of(MATERIALS.index("silk"), 2e4), of(MATERIALS.index("wood"), 5e6)
    assert len(soft.informed.springs) > 1.2 * len(hard.informed.springs)
    np.testing.assert_array_equal(soft.topology.points, hard.topology.points)
    np.testing.assert_array_equal(soft.topology.springs, hard.topology.springs)
    np.testing.assert_array_equal(soft.topology.binding_index, hard.topology.binding_index)
    np.testing.assert_array_equal(soft.twin_anchors.index, hard.twin_anchors.index)


def test_the_world_knows_nothing_of_how_its_twin_was_joined(monkeypatch):
    first = draw_thing("one", "mixed", np.random.default_rng(8))
    metal = (MATERIALS.index("metal"),) * len(first.substances)
    monkeypatch.setattr(module, "draw_materials", lambda *_: metal)
    second = draw_thing("one", "mixed", np.random.default_rng(8))
    assert len(first.topology.springs) != len(second.topology.springs)
    np.testing.assert_array_equal(first.informed.springs, second.informed.springs)
    for name in ("stiffness", "dashpot", "drag_rate"):
        np.testing.assert_array_equal(getattr(first.world, name), getattr(second.world, name))
    np.testing.assert_array_equal(first.handled.surface, second.handled.surface)


def test_dashpots_of_twin_and_world_resist_alike(thing):
    def viscosity(topology, dashpot):
        return float((dashpot * topology.rest_length.astype(np.float64) ** 2).sum())

    twin = viscosity(thing.topology, thing.truth.dashpot_damping)
    assert twin == pytest.approx(viscosity(thing.informed, thing.dashpot))
    assert twin == pytest.approx(viscosity(thing.world.topology, thing.world.dashpot), rel=0.3)
