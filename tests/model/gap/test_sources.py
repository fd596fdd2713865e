"""Shares of a gap by what causes it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import ActuationDelay, StrainStiffening
from model.gap.estimate import Estimate
from model.gap.misfit import Misfit
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.schema import SOURCE_NAMES, Closure
from model.gap.sources import sources

GAP = Closure(baseline=0.02, refit=0.01, with_effect=0.006, noise_floor=0.002, heldout=((1.0, 2.0),))


def misseen(study, points):
    """The study with other places seen, its residuals with them."""
    seen = replace(study.observation, points=points.astype(np.float32))
    observer = Observer(seen, study.plain.at(study.start), 0.3)
    misfit = Misfit(study.plain, observer, study.misfit.span, study.misfit.noise)
    base = replace(study.base, residuals=misfit(study.base.vector[None])[0])
    return replace(study, observation=seen, observer=observer, misfit=misfit, base=base)


def test_they_are_squares_that_sum_to_one(hung, studied):
    study = studied(hung)
    found = sources(GAP, study, study.plain, study.base)
    assert found.parameters == pytest.approx(0.75)
    assert found.physics == pytest.approx((100 - 36) / 400)
    assert sum(getattr(found, name) for name in SOURCE_NAMES) == pytest.approx(1.0)
    # nothing but noise is left in the residuals: neither camera nor hand explains more of the errors
    assert found.perception == pytest.approx(4 / 400, abs=0.01)
    assert found.unexplained == pytest.approx(32 / 400, abs=0.01)


def test_an_effect_of_the_hand_is_actuation(hung, studied, fitted):
    study = studied(hung)
    left = fitted(study, ActuationDelay(), {"actuation_delay.delay": 0.0})
    found = sources(GAP, study, replace(study.plain, effects=(ActuationDelay(),)), left)
    assert found.physics == 0.0
    assert found.actuation >= (100 - 36) / 400


def test_of_two_effects_the_first_has_what_it_takes_away_alone(hung, studied):
    study = studied(hung)
    both = (StrainStiffening(), ActuationDelay())
    misfit = study.misfit.of(replace(study.plain, effects=both))
    usual = {name: quantity.start for name, quantity in misfit.coordinates.quantities.items()}
    silent = {"strain_stiffening.stiffening": 0.0, "actuation_delay.delay": 0.0}
    vector = misfit.coordinates.vector({**usual, **study.base.values, **silent})
    found = misfit.coordinates.values(vector), vector, misfit(vector[None])[0], misfit.jacobian(vector)
    left = Estimate(*found, 0, misfit.belief(found[2], vector))
    late = replace(study.plain, effects=both[::-1])
    for first, alone in ((0.008, 100 - 64), (0.012, 0), (0.004, 100 - 36)):
        found = sources(GAP, study, misfit.hypothesis, left, first)
        assert found.physics == pytest.approx(alone / 400), "what stiffens, no more than there is"
        assert sources(GAP, study, late, left, first).physics == pytest.approx((64 - alone) / 400)
        assert sum(getattr(found, name) for name in SOURCE_NAMES) == pytest.approx(1.0)


def test_a_late_hand_is_actuation(hung, studied):
    late = np.concatenate([hung.controllers[:1], hung.controllers[:-1]])
    study = studied(replace(hung, controllers=late))
    told = replace(study.observation, controllers=hung.controllers)
    plain = replace(study.plain, twin=PlainTwin.of(body_of(told), told))
    misfit = study.misfit.of(plain)
    vector = study.base.vector
    base = replace(study.base, residuals=misfit(vector[None])[0], jacobian=misfit.jacobian(vector))
    deceived = replace(study, observation=told, plain=plain, misfit=misfit, base=base)
    without = GAP.model_copy(update={"with_effect": None})
    found = sources(without, deceived, deceived.plain, base)
    assert found.actuation > 0.5 * (100 - 4) / 400 > found.perception


def test_a_drift_of_the_camera_is_perception(hung, studied):
    study = studied(hung)
    drift = np.linspace(0, 0.03, len(hung.times))[:, None, None] * np.array([0.0, 1.0, 0.0])
    found = sources(GAP, *(lambda s: (s, s.plain, s.base))(misseen(study, study.observation.points + drift)))
    assert found.perception > 0.5 * 36 / 400 > found.actuation


def test_missing_physics_is_neither(pulled, studied):
    places = torch.from_numpy(studied(pulled).plain.twin.body.points)
    study = studied(
        pulled, (StrainStiffening(),), {"strain_stiffening.stiffening": 30.0}, (places[:, 0] < 0.15).double()
    )
    found = sources(GAP, study, study.plain, study.base)
    assert found.unexplained > 0.5 * 32 / 400


@pytest.mark.parametrize("refit", [0.0, 0.03])
def test_errors_out_of_order_are_no_negative_shares(hung, studied, refit):
    study = studied(hung)
    odd = Closure(baseline=0.02 if refit else 0.0, refit=refit, noise_floor=0.05, heldout=((1.0, 2.0),))
    found = sources(odd, study, study.plain, study.base)
    assert found.perception == pytest.approx(1.0)
