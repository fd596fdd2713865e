"""An effect is found at whatever size it has, and what is at work comes first."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from model.gap.effects import (
    ActuationDelay,
    Anisotropy,
    BendingStiffness,
    Plasticity,
    QuadraticAirDrag,
    StrainStiffening,
)
from model.gap.effects.base import Quantity
from model.gap.fields import halves_of, tensor
from model.gap.meeting import able_effects
from model.gap.misfit import Misfit
from model.gap.plain import PlainTwin
from model.gap.probes import probes
from model.gap.search import (
    DEAREST,
    FAINT,
    HALF,
    STRENGTHS,
    affordable,
    beginning,
    known,
    named_probes,
    searched,
    strong,
    values_of,
)

DRAG, DELAY = "quadratic_air_drag.drag_per_mass", "actuation_delay.delay"
YIELDS = {"plasticity.flow_rate": 20.0, "plasticity.yield_strain": 0.02, "plasticity.hardening": 0.2}


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 4.0})


@pytest.fixture
def late(hung, studied):
    return studied(hung, (ActuationDelay(),), {DELAY: 0.2})


def test_what_is_at_work_comes_first(dragged):
    told = []
    found = searched(dragged, able_effects(dragged), told.append)
    assert next(iter(found)) == "quadratic_air_drag"
    left = [one.left for one in found.values()]
    assert left == sorted(left)
    assert told == sorted(told)
    assert 0.0 < told[0] <= told[-1] == 1.0


def test_what_is_far_from_linear_comes_first_as_well(late):
    """A hand that is 0.2 s late, of which multiples of what 0.03 s do foretell little."""
    found = searched(late, able_effects(late))
    assert next(iter(found)) == "actuation_delay"
    values = values_of(late, ActuationDelay(), found["actuation_delay"])
    assert values == {DELAY: pytest.approx(0.2, abs=0.06)}


@pytest.mark.parametrize("probe", [0.25, 1.0, 16.0])
def test_wherever_a_probe_is_the_strength_is_found(dragged, probe):
    found = beginning(dragged, (QuadraticAirDrag(),), [{DRAG: probe}])
    assert values_of(dragged, QuadraticAirDrag(), found)[DRAG] == pytest.approx(4.0, rel=0.8)
    assert found.left < 0.7 * dragged.base.cost


def test_it_leaves_what_it_says(dragged):
    misfit = dragged.misfit.of(replace(dragged.plain, effects=(QuadraticAirDrag(),)))
    found = beginning(dragged, (QuadraticAirDrag(),), [{DRAG: 1.0}])
    assert float((misfit(found.vector[None]) ** 2).mean()) == pytest.approx(found.left, rel=1e-5)


def test_what_helps_in_no_strength_begins_with_hardly_any(dragged):
    """A hand that is late does not explain drag: it may not begin with more left than without it."""

    class Late(ActuationDelay):
        """Always late, and far: no step leads back."""

        quantities: ClassVar = {"delay": Quantity("s", (0.001, 0.4), 0.2, log=True)}

    found = beginning(dragged, (Late(),), [{DELAY: 0.2}])
    assert found.left < 1.1 * dragged.base.cost
    assert values_of(dragged, Late(), found)[DELAY] <= FAINT * 0.2 + 1e-9


def test_two_effects_begin_each_at_its_own_strength(dragged):
    """Of the delay there is nothing: it begins as faint as it may, whatever suits the drag."""
    effects = QuadraticAirDrag(), ActuationDelay()
    both = beginning(dragged, effects, [{DRAG: 1.0, DELAY: 0.04}])
    coordinates = dragged.misfit.of(replace(dragged.plain, effects=effects)).coordinates
    values = coordinates.values(both.vector)
    assert values[DRAG] == pytest.approx(4.0, rel=0.8)
    assert abs(values[DELAY]) < 0.01


def astray(study):
    """The same, but its plain twin was fitted in a valley where springs are a hundred times too stiff."""
    values = {**study.base.values, "stiffness": 100.0 * study.base.values["stiffness"]}
    vector = study.misfit.coordinates.vector(values)
    base = replace(
        study.base,
        values=values,
        vector=vector,
        residuals=study.misfit(vector[None])[0],
        jacobian=study.misfit.jacobian(vector),
    )
    return replace(study, start=study.base.values, base=base)


@pytest.mark.parametrize("given", [False, True])
def test_what_a_given_twin_came_with_is_begun_from_as_well(dragged, monkeypatch, given):
    monkeypatch.setattr(PlainTwin, "given", given)
    study = astray(dragged)
    found = beginning(study, (QuadraticAirDrag(),), [{DRAG: 1.0}])
    stiffness = study.misfit.of(replace(study.plain, effects=(QuadraticAirDrag(),))).coordinates.values(
        found.vector
    )["stiffness"]
    near = stiffness == pytest.approx(dragged.base.values["stiffness"], rel=0.5)
    assert near == given
    assert (found.left < 0.7 * dragged.base.cost) == given


def test_own_parameters_are_looked_at_as_they_would_be_beside_an_effect(pulled, studied, monkeypatch):
    """A plain twin has made up for strong fibres by being too stiff across them."""
    study, fibres, looked = studied(pulled), Anisotropy(), []
    asked = Misfit.__call__

    def seen(misfit, starts):
        looked.append([misfit.coordinates.values(each) for each in starts])
        return asked(misfit, starts)

    monkeypatch.setattr(Misfit, "__call__", seen)
    beginning(study, (fibres,), named_probes(study, fibres))
    count, own = len(looked[0]) // 2, study.base.values["stiffness"]
    assert count >= len(STRENGTHS)
    for alone, eased in zip(looked[0][:count], looked[0][count:], strict=True):
        values = {name: alone[f"anisotropy.{name}"] for name in fibres.quantities}
        assert alone["stiffness"] == pytest.approx(own)
        assert eased["stiffness"] == pytest.approx(own * fibres.beside(values)["stiffness"])
        assert {**eased, "stiffness": own} == pytest.approx(alone)


def test_what_acts_in_a_half_begins_in_that_half(pulled, studied):
    """A sheet of which one half yields where it is pulled."""
    halves = [tensor(place.field) for place in halves_of(studied(pulled).plain.twin.body.points)]
    study = studied(pulled, (Plasticity(),), YIELDS, halves[0])
    plastic = [effect for effect in able_effects(study) if effect.name == "plasticity"]
    found = searched(study, plastic)["plasticity"]
    assert found.where is not None
    apart = [float((found.where - half).abs().max()) for half in halves]
    assert apart.index(min(apart)) == 0
    tried = [{f"plasticity.{name}": value for name, value in one.items()} for one in probes(plastic[0])]
    assert found.left < HALF * beginning(study, tuple(plastic), tried).left
    misfit = study.misfit.of(replace(study.plain, effects=tuple(plastic), where=found.where))
    assert float((misfit(found.vector[None]) ** 2).mean()) == pytest.approx(found.left, rel=1e-5)


def test_halves_are_not_searched_where_rollouts_take_long(pulled, studied, monkeypatch):
    halves = halves_of(studied(pulled).plain.twin.body.points)
    study = studied(pulled, (Plasticity(),), YIELDS, tensor(halves[0].field))
    plastic = [effect for effect in able_effects(study) if effect.name == "plasticity"]
    monkeypatch.setattr("model.gap.study.DEAR", 0.0)
    assert searched(study, plastic)["plasticity"].where is None


def test_what_acts_everywhere_begins_everywhere(pulled, studied):
    study = studied(pulled, (Plasticity(),), YIELDS)
    plastic = [effect for effect in able_effects(study) if effect.name == "plasticity"]
    assert searched(study, plastic)["plasticity"].where is None


def test_only_the_material_is_searched_for_in_halves(dragged):
    assert {effect.name for effect in able_effects(dragged) if effect.local} <= {
        *("strain_stiffening", "viscoelasticity", "plasticity", "damage", "tension_only", "anisotropy"),
        *("bending_stiffness", "volume_preservation"),
    }


def test_strengths_that_need_much_finer_time_steps_are_not_tried(dragged, monkeypatch):
    """Springs that stiffen need fewer strengths than air does; what needs the fewest is always tried."""
    stiffening = dragged.misfit.of(replace(dragged.plain, effects=(StrainStiffening(),)))
    air = dragged.misfit.of(replace(dragged.plain, effects=(QuadraticAirDrag(),)))
    values = dragged.base.values
    (stiff,) = known(stiffening, values, [{"strain_stiffening.stiffening": 500.0}])
    (slow,) = known(air, values, [{DRAG: 1.0}])
    assert factors(affordable(air, [slow])) == STRENGTHS
    needed = {by: stiffening.needs(strong(stiffening, stiff, (by,))) for by in (0.0, *STRENGTHS)}
    cheap = tuple(by for by in STRENGTHS if needed[by] <= DEAREST * needed[0])
    assert factors(affordable(stiffening, [stiff])) == cheap
    monkeypatch.setattr("model.gap.search.DEAREST", 0.1)
    fewest = min(needed[by] for by in STRENGTHS)
    assert factors(affordable(stiffening, [stiff])) == tuple(by for by in STRENGTHS if needed[by] == fewest)


def factors(starts):
    """How strong a single effect is in each."""
    return tuple(by for start in starts for by in start.factors)


def test_each_probe_is_tried_in_the_strengths_that_it_can_afford(hung, studied, monkeypatch):
    """The last may be ten thousand times the first, and needs finer time steps in any strength."""
    study, effect, looked, call = studied(hung, softer=1.0), BendingStiffness(), [], Misfit.__call__
    monkeypatch.setattr(Misfit, "__call__", lambda self, some: looked.append(some) or call(self, some))
    beginning(study, (effect,), named_probes(study, effect))
    misfit = study.misfit.of(replace(study.plain, effects=(effect,)))
    every = known(misfit, study.base.values, named_probes(study, effect))
    whole = np.stack([strong(misfit, values, (by,)) for by in STRENGTHS for values in every])
    needed = np.array([misfit.needs(one) for one in whole])
    cheap = needed <= DEAREST * misfit.needs(strong(misfit, every[0], (0.0,)))
    assert 0 < cheap.sum() < len(whole)
    np.testing.assert_array_equal(looked[0], whole[cheap])
