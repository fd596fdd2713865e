import numpy as np
import pytest

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
