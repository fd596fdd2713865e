from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.scenes.priors import PEAK, with_priors


def test_a_right_expert_names_the_true_materials_and_nothing_else_changes(make_case):
    case = make_case()
    case = replace(case, priors=(case.priors[0],) * 2)
    told = with_priors(case, "right", np.random.default_rng(0))
    for prior, material in zip(told.priors, case.truth.material, strict=True):
        assert PEAK[0] <= prior.distribution[material] <= PEAK[1]
        assert prior.distribution.sum() == pytest.approx(1.0)
        assert prior.shape_class == case.shape_class
        assert prior.properties["density"] == case.priors[0].properties["density"]
    assert told.topology is case.topology
    assert told.observation is case.observation


def test_an_undecided_expert_says_the_same_of_every_part(make_case):
    told = with_priors(make_case(), "uniform", np.random.default_rng(0))
    for prior in told.priors:
        np.testing.assert_allclose(prior.distribution, 0.1)
    assert told.priors[0].properties["stiffness"].spread > 2.0


def test_a_wrong_expert_is_wrong_as_often_as_asked(make_case):
    case, rng = make_case(), np.random.default_rng(1)
    hits = [
        int(prior.distribution.argmax()) == material
        for _ in range(150)
        for prior, material in zip(
            with_priors(case, "wrong", rng, wrong_probability=0.4).priors, case.truth.material, strict=True
        )
    ]
    assert np.mean(hits) == pytest.approx(0.6, abs=0.09)


def test_equal_generators_draw_equal_priors(make_case):
    case = make_case()
    first, second = (with_priors(case, "right", np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(first.priors[1].distribution, second.priors[1].distribution)


def test_without_truth_it_says_so(make_case):
    case = make_case()
    with pytest.raises(InputError, match="true materials are not known"):
        with_priors(replace(case, truth=None), "right", np.random.default_rng(0))
