import numpy as np
import pytest

from model.evaluation.bootstrap import interval, mean_difference, mean_interval


def test_the_mean_is_over_objects_and_not_over_clips():
    found = mean_interval({"a": [1.0] * 10, "b": [3.0], "c": [2.0], "d": [2.0], "e": [2.0]})
    assert found.value == pytest.approx(2.0)
    assert found.objects == 5
    assert 1.0 <= found.low < 2.0 < found.high <= 3.0


def test_few_objects_do_not_say_how_sure_a_figure_is():
    alone = mean_interval({"a": [1.0, 2.0]})
    assert (alone.value, alone.low, alone.high, alone.objects) == (1.5, None, None, 1)
    assert alone.shown(1) == "1.5"
    assert alone.scaled(2.0).shown(1) == "3.0"
    one = mean_difference({("a", "c"): 1.0}, {("a", "c"): 1.001})
    assert one.low is None, "one pair decides nothing"
    values = {name: [float(k)] for k, name in enumerate("abcde")}
    assert mean_interval(dict(list(values.items())[:4])).low is None
    assert mean_interval(values).shown(1).startswith("2.0 [")


def test_clips_of_one_object_do_not_make_a_figure_surer():
    rng = np.random.default_rng(0)
    values = {str(k): [float(v)] for k, v in enumerate(rng.normal(0, 1, 30))}
    many = {name: value * 50 for name, value in values.items()}
    found, more = mean_interval(values), mean_interval(many)
    assert (more.low, more.high) == pytest.approx((found.low, found.high))


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(200):
        found = mean_interval({str(k): [float(v)] for k, v in enumerate(rng.normal(5.0, 2.0, 40))})
        inside += found.low <= 5.0 <= found.high
    assert 0.89 <= inside / 200 <= 0.99


def test_pairs_are_compared_object_by_object():
    rng = np.random.default_rng(2)
    first = {(f"o{k}", "c"): float(10.0 ** rng.uniform(0, 2)) for k in range(20)}
    second = {key: value + 0.5 for key, value in first.items()} | {("alone", "c"): 1e6}
    found = mean_difference(first, second)
    assert found.objects == 20
    assert (found.low, found.value, found.high) == pytest.approx((0.5, 0.5, 0.5))


def test_nothing_says_nothing():
    assert mean_interval({}) is None
    assert mean_difference({("a", "c"): 1.0}, {("b", "c"): 1.0}) is None
    assert interval([], lambda groups: 1.0) is None
    assert interval([1.0], lambda groups: float("nan")) is None


def test_draws_that_say_nothing_do_not_count():
    def spread(groups):
        return float(np.ptp(groups)) if {1.0, 2.0} <= set(groups) else float("nan")

    found = interval([1.0, 1.0, 1.0, 2.0, 2.0], spread)
    assert (found.value, found.low, found.high) == (1.0, 1.0, 1.0)


def test_another_unit():
    found = mean_interval({name: [1.0 + 2.0 * (k % 2)] for k, name in enumerate("abcdef")})
    other = found.scaled(1e3)
    assert (other.value, other.objects) == (2000.0, 6)
    assert (other.low, other.high) == (1e3 * found.low, 1e3 * found.high)
