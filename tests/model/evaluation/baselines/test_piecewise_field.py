import numpy as np
import pytest

from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.piecewise_field import PiecewiseField


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=14)


@pytest.fixture(scope="module")
def fitted(case, hide):
    return PiecewiseField(generations=3, population=6, steps=16).fit(hide(case))


def test_it_fits_what_it_sees(case, hide, errors, fitted):
    coarse = PiecewiseField(generations=3, population=6, steps=0).fit(hide(case))
    assert errors(case, fitted)[0] < 0.7 * errors(case, coarse)[0]
    assert errors(case, fitted)[0] < 0.1 * errors(case, HoldLast().fit(hide(case)))[0]


def test_it_tells_the_softer_part(fitted):
    soft, stiff = fitted.part_belief.log_modulus
    assert np.exp(stiff - soft) > 1.5


def test_the_same_seed_gives_the_same_fit(case, hide):
    made = [PiecewiseField(generations=1, population=4, steps=2).fit(hide(case)) for _ in range(2)]
    assert np.array_equal(made[0].mechanics.stiffness, made[1].mechanics.stiffness)


def test_another_interaction_is_replayed_with_the_springs_found(make_case, hide, errors, fitted):
    other = make_case(frames=10, lift=0.1, name="other")
    assert errors(other, fitted)[0] < 0.2 * errors(other, HoldLast().fit(hide(other)))[0]
