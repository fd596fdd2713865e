from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.baselines.base import Fitted, Twin, carried
from model.predictor.prior_mean import PriorMeanPredictor
from model.scenes.replay import replay


@pytest.fixture
def case(make_case):
    return make_case(frames=8)


@pytest.fixture
def parameters(case):
    return PriorMeanPredictor().from_priors(case.topology, case.priors, "solid", (0.0, 0.0, -9.81), 0.0)


def held_elsewhere(case):
    topology = case.topology
    pairs = topology.controller_springs[:5].copy()
    pairs[:, 1] = np.argsort(-topology.points[:, 0])[:5]
    return replace(
        topology,
        controller_springs=pairs,
        controller_rest_length=topology.controller_rest_length[:5],
    )


def test_the_same_grips_keep_the_parameters(case, parameters):
    assert carried(parameters, case.topology, case.topology) is parameters


def test_another_grip_is_as_firm_over_the_springs_it_holds(case, parameters):
    other = held_elsewhere(case)
    uniform = replace(
        parameters,
        stiffness=np.full_like(parameters.stiffness, 20.0),
        controller_stiffness=np.full_like(parameters.controller_stiffness, 70.0),
    )
    there = carried(uniform, case.topology, other)
    np.testing.assert_array_equal(there.stiffness, uniform.stiffness)
    np.testing.assert_allclose(there.controller_stiffness, np.full(5, 70.0), rtol=1e-6)


def test_a_free_object_is_then_held_as_firmly_as_it_is_stiff(case, parameters):
    free = replace(
        case.topology,
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    loose = replace(parameters, controller_stiffness=np.zeros(0, np.float32))
    there = carried(loose, free, case.topology)
    assert len(there.controller_stiffness) == len(case.topology.controller_springs)
    assert (there.controller_stiffness > 0.0).all()


def test_a_twin_is_what_a_method_may_return(case, parameters):
    twin = Twin(case.topology, parameters)
    assert isinstance(twin, Fitted)
    np.testing.assert_array_equal(twin.predict(case), replay(case, parameters))
