"""How far the gap shrinks, on held-out time and on another recording, with guards."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.closure import MEAN_DISTANCE, closure, transfer
from model.gap.confirm import Fitted
from model.gap.effects import QuadraticAirDrag, StaticFriction
from model.gap.forecast import forecast
from model.gap.transfer import transferred

DRAG = "quadratic_air_drag.drag_per_mass"


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 12.0})


def as_fitted(study, estimate, hypothesis):
    foretold = forecast(study.observer, hypothesis.at(estimate.values), study.split)
    return Fitted(study.misfit.of(hypothesis), estimate, foretold)


@pytest.fixture
def both(dragged, fitted):
    """The plain twin and the one with the right effect, at what is true."""
    true = fitted(dragged, QuadraticAirDrag(), {DRAG: 12.0})
    plain = as_fitted(dragged, dragged.base, dragged.plain)
    return plain, as_fitted(dragged, true, dragged.plain.with_effect(QuadraticAirDrag()))


def test_the_right_effect_closes_the_gap(dragged, both):
    plain, true = both
    found = closure(dragged, plain, true, plain)
    figures = found.closure
    assert figures.refit > 3.0 * figures.with_effect
    assert figures.noise_floor == pytest.approx(MEAN_DISTANCE * dragged.noise)
    low, high = figures.closed_fraction_ci95
    assert low < figures.closed_fraction < high
    assert low > 0.7
    assert figures.heldout == ((dragged.observation.times[dragged.split], dragged.observation.times[-1]),)
    assert set(found.intervals) == {"baseline", "refit", "with_effect", "ceiling"}
    assert all(low <= getattr(figures, name) <= high for name, (low, high) in found.intervals.items())


def test_a_force_that_learned_what_does_not_hold_is_not_the_ceiling(dragged, both):
    plain, true = both
    assert closure(dragged, plain, None, true).closure.ceiling == true.foretold.error
    assert closure(dragged, true, None, plain).closure.ceiling == true.foretold.error


def test_what_changes_nothing_closes_nothing(dragged, both):
    plain, _ = both
    figures = closure(dragged, plain, plain).closure
    assert figures.closed_fraction == 0.0
    assert figures.closed_fraction_ci95 == (0.0, 0.0)


def test_without_a_gap_there_is_no_fraction(dragged, both):
    _, true = both
    noisier = replace(dragged, noise=1.3 * dragged.noise)
    figures = closure(noisier, true, true).closure
    assert figures.closed_fraction is None
    assert figures.closed_fraction_ci95 is None


def test_what_cannot_act_in_another_recording_changes_nothing_there(dragged, both):
    plain, true = both
    elsewhere = transferred(dragged, dragged.observation)
    there = elsewhere.forecast(plain.hypothesis, plain.estimate.values)
    grounded = dragged.misfit.of(replace(true.hypothesis, effects=(StaticFriction(),)))
    found = transfer(dragged, elsewhere, there, replace(true, misfit=grounded))
    assert found.idle
    assert (found.closure.with_effect, found.closure.closed_fraction) == (found.closure.refit, 0.0)
    assert not transfer(dragged, elsewhere, there, true).idle
    assert not transfer(dragged, elsewhere, there).idle


def test_it_closes_on_another_recording_too(dragged, both, studied, hung):
    plain, true = both
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    slower = hung.controllers[0] + 1.5 * (hung.controllers - hung.controllers[0])[::-1][: len(hung.times)]
    slower = slower - slower[0] + hung.controllers[0]
    other = studied(replace(hung, controllers=slower), (QuadraticAirDrag(),), {DRAG: 12.0}).observation
    moved = replace(
        other,
        points=(other.points @ turn.T + [0.4, 0.1, 0.2]).astype(np.float32),
        controllers=(other.controllers @ turn.T + [0.4, 0.1, 0.2]).astype(np.float32),
    )
    elsewhere = transferred(dragged, moved)
    there = elsewhere.forecast(plain.hypothesis, plain.estimate.values)
    found = transfer(dragged, elsewhere, there, true)
    assert found.closure.refit > 2.0 * found.closure.with_effect
    assert found.closure.closed_fraction > 0.6
    assert found.closure.ceiling is None
