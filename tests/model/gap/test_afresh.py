"""A fit of an effect begins anywhere: what it finds does not hang on where the plain twin ended."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.afresh import TIMES, _followed, _starts, afresh
from model.gap.confirm import confirm, refit
from model.gap.effects import BendingStiffness, QuadraticAirDrag
from model.gap.estimate import estimate
from model.gap.probes import probes
from model.gap.search import DEAREST, STRENGTHS
from model.gap.study import starts_of

DRAG, FACING = "quadratic_air_drag.drag_per_mass", "quadratic_air_drag.facing"


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 4.0})


@pytest.fixture
def with_drag(dragged):
    return replace(dragged.plain, effects=(QuadraticAirDrag(),))


@pytest.fixture
def misled(dragged):
    """The plain twin's fit has ended far from what is right."""
    vector = dragged.base.vector.copy()
    vector[dragged.misfit.coordinates.names.index("stiffness")] -= 6.5
    values = dragged.misfit.coordinates.values(vector)
    residuals = dragged.misfit(vector[None])[0]
    return replace(dragged, base=replace(dragged.base, values=values, vector=vector, residuals=residuals))


def test_what_is_at_work_is_found(dragged, with_drag):
    found = afresh(dragged, with_drag)
    assert found.values[DRAG] == pytest.approx(4.0, rel=0.2)
    assert found.cost < 0.7 * dragged.base.cost


def test_wherever_the_plain_twin_ended(dragged, misled, with_drag):
    assert afresh(misled, with_drag).values == afresh(dragged, with_drag).values


def test_a_fit_begins_with_what_another_recording_suggests_too(dragged, with_drag, monkeypatch):
    """Where nothing that is looked at is followed."""
    monkeypatch.setattr("model.gap.afresh._followed", lambda left, strength, count: [])
    found = afresh(dragged, with_drag, {DRAG: 5.0, FACING: 0.9})
    assert found.values[DRAG] == pytest.approx(4.0, rel=0.2)
    assert found.cost < 0.7 * dragged.base.cost


def hasty(misfit, starts, steps, shortest, *, slopes):
    """A fit that is ended early."""
    return estimate(misfit, starts, 2, shortest, slopes=slopes)


def test_a_fit_takes_it_where_it_leaves_less(misled, with_drag, monkeypatch):
    """From the wrong valley a fit of few steps does not get all the way."""
    plain, anew = refit(misled), afresh(misled, with_drag)
    bad = misled.misfit.of(with_drag).coordinates.vector({**misled.base.values, DRAG: 90.0, FACING: 0.9})
    monkeypatch.setattr("model.gap.confirm.estimate", hasty)
    stuck = confirm(misled, plain, with_drag.effects, bad)
    found = confirm(misled, plain, with_drag.effects, bad, anew=anew)
    assert found.estimate.cost < 0.95 * stuck.estimate.cost
    assert found.estimate.cost <= anew.cost * (1.0 + 1e-9)
    worse = replace(anew, residuals=100.0 * anew.residuals)
    ignored = confirm(misled, plain, with_drag.effects, bad, anew=worse)
    assert ignored.estimate.values == stuck.estimate.values


def test_the_plain_twin_may_begin_where_an_effect_was_found(dragged, misled):
    """What an effect explains by another valley of the twin's own parameters it does not explain."""
    good, bad = dict(dragged.base.values), dict(misled.base.values)
    alone, led, own = refit(misled), refit(misled, good), refit(dragged)
    assert led.estimate.cost < 0.97 * alone.estimate.cost
    assert led.estimate.cost == pytest.approx(own.estimate.cost, rel=0.01)
    assert refit(dragged, bad).estimate.values == own.estimate.values


def test_where_rollouts_take_long_each_place_is_looked_at_once(dragged, with_drag, monkeypatch):
    monkeypatch.setattr("model.gap.study.DEAR", 0.0)
    starts, _ = _starts(dragged, dragged.misfit.of(with_drag), QuadraticAirDrag())
    assert len(starts) == len(starts_of(dragged.misfit, dragged.start))


def test_every_strength_of_every_probe_is_looked_at_softest_first(dragged, with_drag):
    misfit = dragged.misfit.of(with_drag)
    starts, strength = _starts(dragged, misfit, QuadraticAirDrag())
    times = TIMES[dragged.plain.twin.body.shape]
    assert len(starts) == times * len(starts_of(dragged.misfit, dragged.start))
    names = misfit.coordinates.names
    assert (np.diff(starts[:, names.index("stiffness")]) >= 0.0).all()
    amounts = {next(iter(probe.values())) for probe in probes(QuadraticAirDrag())}
    low, high = QuadraticAirDrag.quantities["drag_per_mass"].bounds
    expected = {round(float(np.clip(by * each, low, high)), 6) for by in STRENGTHS for each in amounts}
    assert {round(float(np.exp(one)), 6) for one in starts[:, names.index(DRAG)]} == expected
    assert set(strength) == set(STRENGTHS)
    # each place is looked at as often, in strengths of its own
    own = {tuple(np.round(np.delete(one, names.index(DRAG)), 9)) for one in starts}
    assert len(own) == len(starts) // times


def test_no_strength_of_any_probe_is_looked_at_that_needs_much_finer_time_steps(dragged):
    """By the twin that they are compared with: places that are stiffer need finer ones themselves."""
    effect = BendingStiffness()
    misfit = dragged.misfit.of(replace(dragged.plain, effects=(effect,)))
    starts, _ = _starts(dragged, misfit, effect)
    own = dragged.base.values
    needed = [misfit.needs(misfit.coordinates.vector(misfit.coordinates.values(one) | own)) for one in starts]
    assert max(needed) <= DEAREST * dragged.misfit.needs(dragged.base.vector)


def test_where_rollouts_take_long_one_is_followed(dragged, with_drag, monkeypatch):
    monkeypatch.setattr("model.gap.afresh.FOLLOWED", {"sheet": 2})
    often = afresh(dragged, with_drag)
    monkeypatch.setattr("model.gap.study.DEAR", 0.0)
    once = afresh(dragged, with_drag)
    assert often.cost <= once.cost
    counts = []
    monkeypatch.setattr("model.gap.afresh.estimate", lambda *arguments, **others: counts.append(1) or often)
    afresh(dragged, with_drag)
    assert len(counts) == 1


def test_of_two_one_is_faint_and_one_strong():
    left, strength = np.array([3.0, 1.0, 2.0, 5.0]), np.array([0.25, 0.25, 4.0, 16.0])
    assert _followed(left, strength, 2) == [1, 2]
    assert _followed(left, strength, 1) == [1]


def test_where_no_strong_effect_can_be_afforded_none_is_followed():
    left, strength = np.array([9.0, 3.0, 1.0, 2.0]), np.array([0.25, 1.0, 0.25, 1.0])
    assert _followed(left, strength, 2) == [2]
