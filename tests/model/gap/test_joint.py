"""An effect that is as strong in two recordings."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.effects import QuadraticAirDrag, StaticFriction
from model.gap.joint import Joint, fitted_jointly
from model.gap.observer import Observer
from model.gap.search import FAINT
from model.gap.transfer import transferred

DRAG = "quadratic_air_drag.drag_per_mass"
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
    place = here.coordinates.names.index(DRAG)
    assert first[place] == second[place]
    assert len(inside) == len(first) + len(second) - 1
    np.testing.assert_array_equal(both.vector(first, second), inside)


def test_residuals_are_those_of_both_over_what_plain_twins_leave(joint, dragged, other):
    both, here = joint
    values = {**dragged.base.values, DRAG: TRUE}
    there = other.misfit(other.hypothesis(here.hypothesis))
    first = here.coordinates.vector(values)
    second = there.coordinates.vector({**values, **other.own})
    residuals = both(both.vector(first, second)[None])[0]
    alone = here(first[None])[0], there(second[None])[0]
    np.testing.assert_allclose(residuals, np.concatenate([alone[0] / 2.0, alone[1] / 3.0]))
    np.testing.assert_allclose(both.left(residuals), [(one**2).mean() for one in alone])


def test_slopes_are_those_of_what_is_called(joint, dragged, other):
    both, here = joint
    values = {**dragged.base.values, DRAG: TRUE}
    there = other.misfit(other.hypothesis(here.hypothesis))
    at = both.vector(here.coordinates.vector(values), there.coordinates.vector({**values, **other.own}))
    slopes = both.jacobian(at, 0.02)
    for i in range(len(at)):
        moved = at.copy()
        moved[i] += 0.02
        if moved[i] > both.bounds[1][i]:
            continue
        change = (both(moved[None]) - both(at[None]))[0] / 0.02
        np.testing.assert_allclose(slopes[:, i], change, atol=0.02 * np.abs(slopes[:, i]).max() + 1e-6)


def test_what_the_first_recording_gets_wrong_the_other_puts_right(dragged, other, twin):
    """Twice as strong as it is, in the first."""
    plain = twin(dragged)
    elsewhere = other.further(other.followed(plain))
    wrong = twin(dragged, (QuadraticAirDrag(),), {DRAG: 2.0 * TRUE})
    held = other.followed(wrong)
    found = fitted_jointly(wrong, (plain, elsewhere), other, held)
    assert found is not None
    assert found.values[DRAG] == pytest.approx(TRUE, rel=0.15)
    assert found.left[1] < held.estimate.cost
    assert found.left[1] < 0.8 * elsewhere.estimate.cost
    assert found.left[0] < 0.8 * plain.estimate.cost


def test_what_is_not_there_explains_nothing(hung, studied, shaken, twin):
    null = studied(hung)
    other = transferred(null, studied(shaken(hung, 0.06)).observation)
    plain = twin(null)
    elsewhere = other.further(other.followed(plain))
    wrong = twin(null, (QuadraticAirDrag(),), {DRAG: TRUE})
    found = fitted_jointly(wrong, (plain, elsewhere), other, other.followed(wrong))
    assert found is not None
    assert found.values[DRAG] < 2.0 * FAINT * TRUE + 0.1
    assert found.left[0] > 0.95 * plain.estimate.cost
    assert found.left[1] > 0.95 * elsewhere.estimate.cost


def test_what_cannot_act_in_the_other_recording_is_not_shared(hung, studied, twin):
    ground = replace(hung, ground_height=float(hung.points[0, :, 2].min()) - 0.01)
    study = studied(ground)
    other = transferred(study, studied(hung).observation)
    sticky = {f"static_friction.{name}": q.start for name, q in StaticFriction.quantities.items()}
    one = twin(study, (StaticFriction(),), sticky)
    plain = twin(study)
    there = other.followed(plain)
    assert fitted_jointly(one, (plain, there), other, other.followed(one)) is None


def test_a_fitted_twin_is_not_lost_to_its_time_steps(dragged, other, twin, monkeypatch):
    """As by a spring that stiffens: it asks for coarser steps at rest than it needs."""
    plain, found = twin(dragged), twin(dragged, (QuadraticAirDrag(),), {DRAG: TRUE})
    elsewhere = other.further(other.followed(plain))
    held = other.followed(found)
    needed = Observer.substeps
    monkeypatch.setattr(Observer, "substeps", lambda self, world: needed(self, world) // 8)
    coarse = found.misfit.of(found.hypothesis)
    lost = float((coarse(found.estimate.vector[None]) ** 2).mean())
    assert lost > 3.0 * found.estimate.cost
    both = fitted_jointly(found, (plain, elsewhere), other, held)
    assert both is not None
    assert both.left[0] < 1.3 * found.estimate.cost
    assert both.left[1] < 1.3 * held.estimate.cost
