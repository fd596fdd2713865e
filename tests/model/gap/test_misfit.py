"""What a fit makes small."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.belief import LOOSE
from model.gap.effects import StrainStiffening
from model.gap.misfit import Span
from model.gap.observer import Observer
from model.simulator.system import State

STIFFENING = "strain_stiffening.stiffening"


@pytest.fixture
def stiffening(hung, studied):
    study = studied(hung)
    misfit = study.misfit.of(replace(study.plain, effects=(StrainStiffening(),)))
    return misfit, misfit.coordinates.vector({**study.base.values, STIFFENING: 2000.0})


def left(misfit, vector):
    return float((misfit(vector[None]) ** 2).mean())


def test_time_is_divided_for_the_strain_of_where_a_recording_begins(stiffening):
    misfit, vector = stiffening
    world = misfit.hypothesis.at(misfit.coordinates.values(vector))

    def needs(stretch):
        places = world.system.points * stretch
        return misfit.through(misfit.observer, Span(0, misfit.span.last, State(places, 0.0 * places))).needs(
            vector
        )

    assert needs(1.2) > misfit.needs(vector)
    tangents = [1.0 + 3.0 * 2000.0 * strain**2 for strain in (0.2, 0.3)]
    # dashpots, which do not stiffen, ask for some of it
    assert needs(1.3) / needs(1.2) == pytest.approx((tangents[1] / tangents[0]) ** 0.5, rel=0.15)


@pytest.mark.parametrize("coarser", [6, 8])
def test_who_is_lost_to_time_steps_gets_finer_ones(stiffening, monkeypatch, coarser):
    misfit, vector = stiffening
    right = left(misfit, vector)
    needed = Observer.substeps
    monkeypatch.setattr(Observer, "substeps", lambda *asked: max(1, needed(*asked) // coarser))
    coarse = misfit.of(misfit.hypothesis)
    assert left(coarse, vector) > 2.0 * right
    coarse.divide(vector)
    assert left(coarse, vector) == pytest.approx(right, rel=0.1)
    part = coarse.until(coarse.span.last // 2)
    assert np.isfinite(part(vector[None])).all()
    assert part._substeps == coarse._substeps


def test_who_is_not_lost_keeps_the_time_steps(stiffening):
    misfit, vector = stiffening
    before = left(misfit, vector)
    kept = misfit._substeps
    misfit.divide(vector)
    assert misfit._substeps == kept
    assert left(misfit, vector) == before


def test_what_is_believed_is_of_the_twin_wherever_a_fit_begins(stiffening):
    """An effect, of which nothing is known, stays near where its fit begins."""
    misfit, vector = stiffening
    residuals = misfit(vector[None])[0]
    own = np.array([name != STIFFENING for name in misfit.coordinates.names])
    for around in (vector, misfit.bounds[1]):
        belief = misfit.belief(residuals, around)
        sure = own & np.isfinite(misfit.coordinates.spreads)
        np.testing.assert_array_equal(belief.centre[sure], misfit.coordinates.starts[sure])
        np.testing.assert_array_equal(belief.centre[~sure], around[~sure])
        assert (belief.unit[sure] >= 1.0).all()
        assert (belief.unit[~sure] == 1.0).all()
        assert (belief.spread[~own] == LOOSE).all()


def test_the_worse_a_twin_follows_the_more_is_left_to_belief(hung, studied):
    study = studied(hung)
    misfit, vector = study.misfit, study.base.vector
    softer = vector - 2.0 * np.array([name == "stiffness" for name in misfit.coordinates.names])
    assert left(misfit, softer) > 4.0 * left(misfit, vector)
    at, off = (misfit.belief(misfit(one[None])[0], vector).unit.max() for one in (vector, softer))
    assert off > 2.0 * at


def test_residuals_have_their_frames_and_points(stiffening):
    misfit, vector = stiffening
    residuals = misfit(vector[None])[0]
    field = misfit.field(residuals)
    assert field.shape == (misfit.span.last + 1, misfit.observer.places.shape[1], 3)
    assert not field[0].any()
    assert (field**2).sum() == pytest.approx((residuals**2).sum())
