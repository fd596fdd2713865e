"""Which effects are fitted: likely ones first, and others where a force that may be anything says so."""

import numpy as np
import pytest

from model.gap.contest import FITTED, THERE, contested, explain_too_little, likely, with_simpler
from model.gap.effects import GravityTilt, QuadraticAirDrag, SteadyWind
from model.gap.schema import EFFECT_NAMES
from model.gap.screen import screen
from model.gap.search import Begun
from model.gap.verdict import Judged

SURE = "quadratic_air_drag"


@pytest.fixture
def misled(jury_sure_of, monkeypatch):
    """One effect is fitted at a time, and the jury believes in the wrong one."""
    jury_sure_of(SURE, (QuadraticAirDrag, GravityTilt, SteadyWind))
    monkeypatch.setattr("model.gap.contest.FITTED", dict.fromkeys(FITTED, 1))


def test_what_the_jury_believes_what_promises_and_what_leaves_least_comes_first():
    names = list(EFFECT_NAMES)
    # the later in the catalogue the more it promises, the earlier the less it leaves
    begins = {name: Begun(np.zeros(1), 1.0, promised=-float(place)) for place, name in enumerate(names)}
    order = likely(begins, Judged({name: float(name == names[8]) for name in names}))
    assert order[:5] == [names[8], names[-1], names[0], names[-2], names[1]]
    assert sorted(order) == sorted(names)


@pytest.mark.parametrize(
    ("shape", "names", "fitted"),
    [
        ("rope", ["plasticity", "wind"], ["plasticity", "wind", "bending_stiffness"]),
        ("rope", ["bending_stiffness", "plasticity"], ["bending_stiffness", "plasticity"]),
        ("rope", ["wind"], ["wind"]),
        ("sheet", ["plasticity"], ["plasticity"]),
    ],
)
def test_a_rope_that_may_yield_may_be_elastic(shape, names, fitted):
    assert with_simpler(names, list(EFFECT_NAMES), shape) == fitted
    unable = [name for name in EFFECT_NAMES if name != "bending_stiffness"]
    if "bending_stiffness" not in names:
        assert with_simpler(names, unable, shape) == names


@pytest.mark.parametrize(
    ("force", "effects", "more"),
    [
        (0.5, (0.1, 0.24), True),
        (0.5, (0.1, 0.26), False),
        (0.5, (), True),
        (THERE - 0.01, (0.0,), False),
        (-0.3, (0.2,), False),
    ],
    ids=["too little", "half of it", "nothing was fitted", "nothing is there", "the force was lost"],
)
def test_what_is_there_and_not_explained(force, effects, more):
    left = [8.0 * np.exp(-one) for one in (force, *effects)]
    assert explain_too_little(8.0, left[0], left[1:]) == more


@pytest.mark.slow
def test_where_the_likely_explain_too_little_others_are_fitted(short, studied, misled):
    study = studied(short, (GravityTilt(),), {"gravity_tilt.about_y": 0.35}, softer=1.0)
    told = []
    screened = screen(study, None, lambda stage, share: None)
    contest = contested(study, screened, lambda stage, share: told.append((stage, share)))
    order = likely(screened.begins, screened.first)
    assert order[0] == SURE
    assert list(contest.confirmed) == order[:2], "as many again, no more"
    assert contest.confirmed[order[1]].estimate.cost < 0.5 * contest.confirmed[SURE].estimate.cost
    assert {stage for stage, _ in told} == {"confirm"}
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.3, 0.75)
    # all are compared with one plain twin, but for hardly any of an effect that is left where it does harm
    most = 1.002 * contest.plain.estimate.cost
    assert all(one.estimate.cost <= most for one in contest.confirmed.values())


@pytest.mark.slow
def test_where_rollouts_are_not_quick_there_is_no_second_round(short, studied, misled, monkeypatch):
    monkeypatch.setattr("model.gap.contest.QUICK", 0.0)
    study = studied(short, (GravityTilt(),), {"gravity_tilt.about_y": 0.35}, softer=1.0)
    contest = contested(study, screen(study, None, lambda stage, share: None), lambda stage, share: None)
    assert list(contest.confirmed) == [SURE]


@pytest.mark.slow
def test_where_nothing_is_missing_no_others_are_fitted(short, studied, misled):
    study = studied(short, softer=1.0)
    screened = screen(study, None, lambda stage, share: None)
    contest = contested(study, screened, lambda stage, share: None)
    assert list(contest.confirmed) == [SURE]


@pytest.mark.slow
def test_where_rollouts_take_long_fewer_are_fitted(short, studied, misled, monkeypatch):
    monkeypatch.setattr("model.gap.contest.FITTED_DEAR", 0)
    monkeypatch.setattr("model.gap.contest.LABORIOUS", dict.fromkeys(FITTED, 0.0))
    study = studied(short, softer=1.0)
    contest = contested(study, screen(study, None, lambda stage, share: None), lambda stage, share: None)
    assert contest.confirmed == {}
    assert contest.flexible.estimate.cost <= contest.plain.estimate.cost
