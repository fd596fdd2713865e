"""An effect that is as strong in two recordings."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.confirm import refit
from model.gap.effects import GravityTilt, QuadraticAirDrag
from model.gap.joint import Joint, fitted_jointly
from model.gap.observer import Observer
from model.gap.search import FAINT
from model.gap.slowly import left_slowly
from model.gap.transfer import transferred

DRAG, FACING = "quadratic_air_drag.drag_per_mass", "quadratic_air_drag.facing"
TRUE = 4.0


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: TRUE})


@pytest.fixture
def other(hung, studied, dragged, shaken):
    seen = studied(shaken(hung, 0.06), (QuadraticAirDrag(),), {DRAG: TRUE}).observation
    return transferred(dragged, seen)


@pytest.fixture
def joint(dragged, other):
    effects = (QuadraticAirDrag(),)
    here = dragged.misfit.of(replace(dragged.plain, effects=effects))
    return Joint((here, other.misfit(other.hypothesis(here.hypothesis))), (4.0, 9.0)), here


def test_coordinates_of_the_effect_are_shared_and_all_others_apart(joint):
    both, here = joint
    low, high = both.bounds
    assert (low < high).all()
    inside = 0.4 * low + 0.6 * high
    first, second = both.of_each(inside)
    for name in (DRAG, FACING):
        place = here.coordinates.names.index(name)
        assert first[place] == second[place]
    assert len(inside) == len(first) + len(second) - 2
    np.testing.assert_array_equal(both.vector(first, second), inside)


def test_residuals_are_those_of_both_over_what_plain_twins_leave(joint, dragged, other):
    both, here = joint
    values = {**dragged.base.values, DRAG: TRUE, FACING: 0.9}
    there = other.misfit(other.hypothesis(here.hypothesis))
    first = here.coordinates.vector(values)
    second = there.coordinates.vector({**values, **other.own})
    residuals = both(both.vector(first, second)[None])[0]
    alone = here(first[None])[0], there(second[None])[0]
    usual = 0.5 * (here.size + there.size)
    scaled = (alone[0] * (usual / here.size) ** 0.5 / 2.0, alone[1] * (usual / there.size) ** 0.5 / 3.0)
    np.testing.assert_allclose(residuals, np.concatenate(scaled))
    np.testing.assert_allclose(both.left(residuals), [(one**2).mean() for one in alone])


def test_slopes_are_those_of_what_is_called(joint, dragged, other):
    both, here = joint
    values = {**dragged.base.values, DRAG: TRUE, FACING: 0.9}
    there = other.misfit(other.hypothesis(here.hypothesis))
    at = both.vector(here.coordinates.vector(values), there.coordinates.vector({**values, **other.own}))
    slopes = both.jacobian(at, 0.02)
    for i in range(len(at)):
        moved = at.copy()
        moved[i] += 0.02
        if moved[i] > both.bounds[1][i]:
            continue
        change = (both(moved[None]) - both(at[None]))[0] / 0.02
        rounding = 0.01  # of single precision, over a step of 0.02
        np.testing.assert_allclose(slopes[:, i], change, atol=0.02 * np.abs(slopes[:, i]).max() + rounding)


def test_what_the_first_recording_gets_wrong_the_other_puts_right(dragged, other, twin):
    """Twice as strong as it is, in the first."""
    plain = twin(dragged)
    elsewhere = other.further(other.followed(plain))
    wrong = twin(dragged, (QuadraticAirDrag(),), {DRAG: 2.0 * TRUE})
    held = other.followed(wrong)
    found = fitted_jointly(wrong, plain, other, elsewhere)
    assert found is not None
    assert found.values[DRAG] == pytest.approx(TRUE, rel=0.15)
    assert found.left[1] < held.estimate.cost
    assert found.left[1] < 0.8 * elsewhere.estimate.cost
    assert found.left[0] < 0.8 * plain.estimate.cost
    assert found.slowly[0].mean() < 0.8 * left_slowly(plain.misfit, plain.estimate.values).mean()
    assert found.slowly[1].mean() < 0.8 * left_slowly(elsewhere.misfit, elsewhere.estimate.values).mean()


def test_who_is_not_yet_followed_in_the_other_recording_begins_where_the_plain_twin_is(
    dragged, other, twin, monkeypatch
):
    """One round may not be enough there; from hardly any of the effect the fit would not find it."""
    plain = twin(dragged)
    elsewhere = other.further(other.followed(plain))
    found = twin(dragged, (QuadraticAirDrag(),), {DRAG: TRUE})
    held = other.followed(found)
    soft = {**held.estimate.values, "stiffness": 0.05 * held.estimate.values["stiffness"]}
    lost = held._replace(estimate=replace(held.estimate, values=soft))
    monkeypatch.setattr(type(other), "followed", lambda *_: lost)
    both = fitted_jointly(found, plain, other, elsewhere)
    assert both is not None
    assert both.values[DRAG] == pytest.approx(TRUE, rel=0.15)
    assert both.left[0] < 1.2 * found.estimate.cost
    assert both.left[1] < 0.8 * elsewhere.estimate.cost


@pytest.mark.parametrize(
    ("effect", "strength"),
    [
        (QuadraticAirDrag(), {DRAG: TRUE}),
        (GravityTilt(), {"gravity_tilt.about_x": 0.1, "gravity_tilt.about_y": -0.05}),
    ],
)
def test_what_is_not_there_explains_nothing(hung, studied, shaken, twin, effect, strength):
    null = studied(hung)
    other = transferred(null, studied(shaken(hung, 0.06)).observation)
    plain = twin(null)
    elsewhere = other.further(other.further(other.followed(plain)))
    found = fitted_jointly(twin(null, (effect,), strength), plain, other, elsewhere)
    assert found is not None
    for name, value in strength.items():
        assert abs(found.values[name]) < 2.0 * FAINT * abs(value) + 0.1 * abs(value)
    assert found.left[0] > 0.95 * plain.estimate.cost
    # below the noise a tilt still explains how far off the first pose is
    assert found.left[1] > 0.95 * elsewhere.estimate.cost or 0.7 < found.left[1] < 1.0


def test_what_is_there_in_one_recording_alone_is_not_explained_in_both(hung, studied, shaken, twin):
    """A tilted camera, say: what it takes away here it gives back there."""
    tilt = {"gravity_tilt.about_x": 0.1, "gravity_tilt.about_y": -0.05}
    tilted = studied(hung, (GravityTilt(),), tilt)
    other = transferred(tilted, studied(shaken(hung, 0.06)).observation)
    plain = refit(tilted)
    elsewhere = other.further(other.further(other.followed(plain)))
    one = twin(tilted, (GravityTilt(),), tilt)
    alone = np.log(plain.estimate.cost / one.estimate.cost)
    found = fitted_jointly(one, plain, other, elsewhere)
    assert found is not None
    both = np.log([plain.estimate.cost / found.left[0], elsewhere.estimate.cost / found.left[1]])
    assert alone > 1.0
    assert both.sum() < 0.7 * alone
    assert both.min() < 0.1 * alone


def test_what_cannot_act_in_the_other_recording_is_not_shared(grounded, twin):
    study, other, one = grounded
    plain = twin(study)
    there = other.followed(plain)
    assert fitted_jointly(one, plain, other, there) is None


def test_a_fitted_twin_is_not_lost_to_its_time_steps(dragged, other, twin, monkeypatch):
    """As by a spring that stiffens: it asks for coarser steps at rest than it needs."""
    plain, found = twin(dragged), twin(dragged, (QuadraticAirDrag(),), {DRAG: TRUE})
    elsewhere = other.further(other.followed(plain))
    held = other.followed(found)
    needed = Observer.substeps
    monkeypatch.setattr(Observer, "substeps", lambda self, *world: needed(self, *world) // 4)
    coarse = found.misfit.of(found.hypothesis)
    lost = float((coarse(found.estimate.vector[None]) ** 2).mean())
    assert lost > 1.4 * found.estimate.cost
    found = replace(found, misfit=coarse)
    both = fitted_jointly(found, plain, other, elsewhere)
    assert both is not None
    assert both.left[0] < 1.2 * found.estimate.cost
    assert both.left[1] < 1.3 * held.estimate.cost


def test_each_recording_believes_of_its_own_what_it_would_alone(joint, dragged, other):
    both, here = joint
    values = {**dragged.base.values, DRAG: TRUE, FACING: 0.9}
    there = other.misfit(other.hypothesis(here.hypothesis))
    first, second = here.coordinates.vector(values), there.coordinates.vector({**values, **other.own})
    at = both.vector(first, second)
    believed = both.belief(both(at[None])[0], at)
    usual = 0.5 * (here.size + there.size)
    for side, misfit, vector, left in ((0, here, first, 4.0), (1, there, second, 9.0)):
        alone, scale = misfit.belief(misfit(vector[None])[0], vector), (usual / misfit.size / left) ** 0.5
        own = np.array([name not in (DRAG, FACING) for name in misfit.coordinates.names])
        for part, by in (("centre", 1.0), ("spread", 1.0), ("unit", scale)):
            together = both.of_each(getattr(believed, part))[side]
            np.testing.assert_allclose(together[own], by * getattr(alone, part)[own])
