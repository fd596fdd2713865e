"""What a fit makes small."""

from dataclasses import replace

import numpy as np
import pytest

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
