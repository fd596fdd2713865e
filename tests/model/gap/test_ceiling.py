"""What a flexible force explains: much of what is missing, and nothing of nothing."""

import numpy as np
import pytest

from model.gap.ceiling import ceiling
from model.gap.confirm import refit
from model.gap.effects import QuadraticAirDrag, SteadyWind


@pytest.mark.slow
def test_it_explains_what_it_has_no_name_for(hung, studied):
    wind = {"wind.drag_per_mass": 1.0, "wind.x": 2.0, "wind.y": 2.0}
    study = studied(hung, (SteadyWind(),), wind, softer=3.0)
    plain = refit(study)
    found = ceiling(study, plain)
    assert found.estimate.cost < 0.6 * plain.estimate.cost
    # in worlds next to this one, a fiftieth more wind or noise, it is a fifth to seven tenths
    assert found.foretold.error < 0.8 * plain.foretold.error


@pytest.mark.slow
def test_where_nothing_is_missing_it_explains_nothing(hung, studied):
    study = studied(hung)
    plain = refit(study)
    found = ceiling(study, plain)
    rounding = 2e-5  # of rollouts in single precision
    assert (1 + rounding) * plain.estimate.cost >= found.estimate.cost > 0.9 * plain.estimate.cost
    assert found.foretold.error > 0.9 * plain.foretold.error


def test_it_has_only_what_can_act(hung, studied):
    study = studied(hung, (QuadraticAirDrag(),))
    found = ceiling(study, refit(study))
    names = {effect.name for effect in found.hypothesis.effects}
    assert names == {"residual_material", "residual_air", "residual_grip", "residual_bending"}


def test_it_is_not_held_to_what_is_usual(hung, studied):
    """Of the twin beside it either: else the force could not take over what goes with an unusual one."""
    study = studied(hung)
    plain = refit(study)
    assert np.isfinite(plain.misfit.coordinates.spreads).any()
    assert not np.isfinite(ceiling(study, plain).misfit.coordinates.spreads).any()
