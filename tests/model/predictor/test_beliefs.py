from dataclasses import replace

import numpy as np
import pytest

from model.predictor.beliefs import BELIEFS, describe_beliefs, log_means
from model.priors.materials import combine
from model.types import Estimate, MaterialPrior

GRAVITY = (0.0, 0.0, -9.81)


def belief(distribution):
    distribution = np.asarray(distribution, np.float64)
    return MaterialPrior(distribution, combine(distribution, "solid"), "solid")


def test_every_belief_is_of_order_one_and_none_is_like_another():
    priors = [belief(row) for row in np.eye(10)] + [belief(np.full(10, 0.1))]
    found = describe_beliefs(priors, 0.3, GRAVITY)
    assert found.shape == (11, BELIEFS)
    assert np.abs(found).max() < 4.0
    assert len(np.unique(found.round(4), axis=0)) == 11


def test_what_is_sure_and_what_is_sturdy():
    sure, unsure = belief(np.eye(10)[2]), belief(np.full(10, 0.1))
    found = describe_beliefs([sure, unsure], 0.3, GRAVITY)
    assert (found[1, -3:-1] > found[0, -3:-1]).all()  # spread, entropy
    stiffer = replace(sure, properties={**sure.properties, "stiffness": Estimate(1e7, 0.8, "Pa")})
    other = describe_beliefs([stiffer, unsure], 0.3, GRAVITY)
    assert other[0, -1] - found[0, -1] == pytest.approx(np.log(1e7 / 5e5) / 3, rel=1e-4)
    # a body twice as large carries twice its weight
    larger = describe_beliefs([sure, unsure], 0.6, GRAVITY)
    np.testing.assert_allclose(larger[:, -1] - found[:, -1], -np.log(2) / 3, rtol=1e-4)
    assert np.isfinite(describe_beliefs([sure], 0.3, (0.0, 0.0, 0.0))).all()


def test_log_means_are_in_the_order_asked_for():
    sure = belief(np.eye(10)[2])
    np.testing.assert_allclose(log_means([sure], ("friction", "stiffness")), np.log([[0.8, 5e5]]))
