import numpy as np
import pytest

from model.evaluation.jackknife import spread_interval


def pooled(groups):
    values = np.concatenate(groups)
    return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")


def test_intervals_of_a_spread_hold_the_truth_as_often_as_they_say():
    # a bootstrap over the same objects holds it in about two thirds of the draws
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(300):
        # two values of an object have something in common
        found = spread_interval([rng.normal(0.0, 0.6) + rng.normal(0.0, 0.8, 2) for _ in range(24)], pooled)
        inside += found.low <= 1.0 <= found.high
    assert 0.90 <= inside / 300 <= 0.99


def test_a_spread_is_not_made_smaller():
    groups = [np.array([1.0, 3.0 + 0.1 * k]) for k in range(8)]
    found = spread_interval(groups, pooled)
    assert found.value == pytest.approx(np.std(np.concatenate(groups), ddof=1))
    assert found.low < found.value < found.high


def test_few_objects_nothing_and_no_spread():
    assert spread_interval([], pooled) is None
    assert spread_interval([np.array([1.0])], pooled) is None
    few = spread_interval([np.array([1.0, 2.0])] * 4, pooled)
    assert few.low is None
    assert spread_interval([np.array([1.0, 1.0])] * 9, pooled).high is None, "no spread has no logarithm"
