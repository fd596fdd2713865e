from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.two_stage import TwoStage


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=14)


@pytest.fixture(scope="module")
def fitted(case, hide):
    return TwoStage(generations=3, population=6, steps=12).fit(hide(case))


def test_it_fits_what_it_sees(case, hide, errors, fitted):
    coarse = TwoStage(generations=3, population=6, steps=0).fit(hide(case))
    assert errors(case, fitted)[0] < 0.7 * errors(case, coarse)[0]
    assert errors(case, fitted)[0] < 0.1 * errors(case, HoldLast().fit(hide(case)))[0]


def test_the_second_stage_tells_the_softer_part(case, fitted):
    soft, stiff = fitted.part_belief.log_modulus
    assert np.exp(stiff - soft) > 1.5
    assert fitted.part_belief.log_spread is None


def test_the_same_seed_gives_the_same_fit(case, hide):
    first, second = (TwoStage(generations=1, population=4, steps=1).fit(hide(case)) for _ in range(2))
    assert np.array_equal(first.mechanics.stiffness, second.mechanics.stiffness)


def test_springs_are_taken_along_to_another_grip(make_case, hide, fitted):
    other = hide(make_case(frames=8, lift=0.1, name="other"))
    grip = replace(
        other.topology,
        controller_springs=other.topology.controller_springs[:4],
        controller_rest_length=other.topology.controller_rest_length[:4],
        controller_points=other.topology.controller_points[:1],
    )
    seen = replace(other.observation, controllers=other.observation.controllers[:, :1])
    made = fitted.predict(replace(other, topology=grip, observation=seen))
    assert made.shape == other.observation.points.shape
    assert np.isfinite(made).all()


def test_a_modulus_that_the_prior_misses_is_found(make_case, hide):
    case = make_case(frames=10, modulus=(6e3, 6e3))
    stiffer = tuple(
        replace(
            prior,
            properties={
                **prior.properties,
                "stiffness": replace(prior.properties["stiffness"], mean=6e4),
            },
        )
        for prior in case.priors
    )
    fitted = TwoStage(generations=8, population=8, steps=0).fit(hide(replace(case, priors=stiffer)))
    assert abs(fitted.part_belief.log_modulus[0] - np.log(6e3)) < 0.7
