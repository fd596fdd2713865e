"""The right effect is found with its size, a wrong one changes nothing, and both get the same chance."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import torch

from model.gap.acts_on import acting
from model.gap.confirm import confirm, fitted, further, held_out, intervals, localised, refit
from model.gap.effects import QuadraticAirDrag, StrainStiffening
from model.gap.effects.base import Effect, Quantity
from model.gap.search import beginning

STIFFENING = "strain_stiffening.stiffening"
DRAG, FACING = "quadratic_air_drag.drag_per_mass", "quadratic_air_drag.facing"


def confirmed(study, plain, effects, values):
    return confirm(study, plain, effects, beginning(study, effects, [values]).vector)


class Placebo(Effect):
    """A number that nothing depends on."""

    name = "placebo"
    source = "Reference: none"
    acts = "body"
    quantities: ClassVar = {"amount": Quantity("1", (0.01, 100.0), 1.0, log=True)}
    absent: ClassVar = {"amount": 0.0}

    def apply(self, world, values, where=None):
        return world


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 4.0})


@pytest.fixture
def null(hung, studied):
    return studied(hung)


def test_what_was_planted_is_confirmed(dragged):
    plain = refit(dragged)
    assert plain.estimate.cost < dragged.base.cost
    found = confirmed(dragged, plain, (QuadraticAirDrag(),), {DRAG: 1.0})
    assert found.estimate.cost < 0.7 * plain.estimate.cost
    assert found.estimate.values[DRAG] == pytest.approx(4.0, rel=0.2)
    low, high = found.intervals[DRAG]
    assert low < 4.0 < high < 3.0 * low
    assert found.foretold.error < 0.9 * plain.foretold.error
    assert found.evidence > 1000.0
    assert held_out(dragged, found.foretold) < 0.7 * held_out(dragged, plain.foretold)
    assert found.at_bound == ()
    assert set(found.intervals) == {DRAG, FACING}


def test_what_a_twin_leaves_beyond_noise_widens_intervals_twice(dragged):
    """As what differs between blocks of time, and for what is alike in all of them."""
    found = fitted(
        dragged,
        replace(dragged.plain, effects=(QuadraticAirDrag(),)),
        beginning(dragged, (QuadraticAirDrag(),), [{DRAG: 4.0}]).vector,
    )
    worse = replace(found, estimate=replace(found.estimate, residuals=3.0 * found.estimate.residuals))
    widths = [np.diff(np.log(intervals(dragged, one, [DRAG])[DRAG])).item() for one in (found, worse)]
    assert found.estimate.cost == pytest.approx(1.0, abs=0.1)
    assert widths[1] / widths[0] == pytest.approx(9.0, rel=0.1)


def test_a_placebo_closes_nothing(dragged):
    plain = refit(dragged)
    found = confirmed(dragged, plain, (Placebo(),), {})
    # the plain twin is followed further than what explains nothing: it may only be ahead
    assert 0.98 * plain.foretold.error < found.foretold.error < 1.05 * plain.foretold.error
    assert -2.0 < found.evidence < 1.0
    low, high = found.intervals["placebo.amount"]
    assert high > 100.0 * low  # nothing is known of it


def test_where_nothing_is_missing_nothing_is_found(null):
    plain = refit(null)
    found = confirmed(null, plain, (QuadraticAirDrag(),), {DRAG: 1.0})
    assert found.foretold.error == pytest.approx(plain.foretold.error, rel=0.05)
    assert abs(found.evidence) < 20.0  # -6 to 8 in ten draws of the noise; of what was planted 5500
    assert found.estimate.values[DRAG] < 0.5


def test_an_absurd_amount_is_told(dragged):
    plain = refit(dragged)

    class Faint(QuadraticAirDrag):
        quantities: ClassVar = {
            **QuadraticAirDrag.quantities,
            "drag_per_mass": Quantity("1/m", (0.005, 1.0), 0.5, log=True),
        }

    found = confirmed(dragged, plain, (Faint(),), {DRAG: 0.5})
    assert found.at_bound == (DRAG, FACING)
    assert found.intervals[DRAG][1] <= 1.0 + 1e-9


def test_two_effects_are_fitted_together(dragged):
    plain = refit(dragged)
    found = confirmed(dragged, plain, (QuadraticAirDrag(), Placebo()), {DRAG: 1.0})
    assert set(found.intervals) == {DRAG, FACING, "placebo.amount"}
    assert found.estimate.values[DRAG] == pytest.approx(4.0, rel=0.2)
    assert np.isfinite(found.evidence)


def test_what_acts_in_a_half_is_fitted_there(pulled, studied):
    """On all alike a half that stiffens looks half as stiffening; a place that explains less is not taken."""
    places = torch.from_numpy(studied(pulled).plain.twin.body.points)
    left = (places[:, 0] < 0.15).double()
    study = studied(pulled, (StrainStiffening(),), {STIFFENING: 60.0}, left, softer=1.0)
    plain = refit(study)
    everywhere = confirmed(study, plain, (StrainStiffening(),), {STIFFENING: 30.0})
    place = acting(study, everywhere.estimate, StrainStiffening())
    there = localised(study, plain, everywhere, place)
    assert there.estimate.cost < 0.8 * everywhere.estimate.cost
    assert there.hypothesis.where is place.where
    exact = replace(everywhere.estimate, residuals=0.0 * everywhere.estimate.residuals)
    perfect = replace(everywhere, estimate=exact)
    assert localised(study, plain, perfect, place) is perfect
    assert localised(study, plain, everywhere, replace(place, where=None)) is everywhere
    kept = acting(study, there.estimate, StrainStiffening(), there.hypothesis.where)
    assert kept.local
    np.testing.assert_array_equal(kept.field, there.hypothesis.where.numpy())
    assert localised(study, plain, there, kept) is there


def test_a_promising_fit_is_followed_to_its_end(dragged):
    """From a start far off, four steps stop on the way; one that explains nothing is not followed at all."""
    plain = refit(dragged)
    hypothesis = replace(dragged.plain, effects=(QuadraticAirDrag(),))
    start = dragged.misfit.of(hypothesis).coordinates.vector({**dragged.base.values, DRAG: 0.05, FACING: 0.9})
    short = fitted(dragged, hypothesis, start, steps=1)
    longer = further(dragged, short)
    assert longer.estimate.cost < 0.9 * short.estimate.cost
    assert longer.estimate.values[DRAG] == pytest.approx(4.0, rel=0.1)
    assert further(dragged, longer).estimate.cost <= longer.estimate.cost
    assert plain.estimate.cost <= fitted(dragged, dragged.plain, dragged.base.vector).estimate.cost


def test_a_fit_that_ends_worse_than_the_refitted_twin_is_made_from_there(null):
    """Else what the plain twin found after the search would count against every effect."""
    plain, effect = refit(null), QuadraticAirDrag()
    misfit = null.misfit.of(replace(null.plain, effects=(effect,)))
    values = {**plain.estimate.values, "stiffness": 200.0 * plain.estimate.values["stiffness"]}
    start = misfit.coordinates.vector({**values, DRAG: 1.0, FACING: 0.9})
    assert fitted(null, misfit.hypothesis, start).estimate.cost > 1.05 * plain.estimate.cost
    found = confirm(null, plain, (effect,), start)
    assert found.estimate.cost < 1.01 * plain.estimate.cost
