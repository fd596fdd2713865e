"""Against cases worked out by hand."""

import numpy as np
import pytest

from model.gap.benchmark.scores import (
    Score,
    acting,
    area_under,
    bin_of,
    bootstrapped,
    brier,
    calibration_error,
    calibration_error_by_chance,
    closed,
    confusion,
    macro_f1,
    mean,
    overlap,
    proportion,
)


def test_proportions_have_wilsons_interval():
    # Wilson for 8 of 10: (0.8 + 0.19207) / 1.38415 ± 1.96 / 1.38415 · sqrt(0.016 + 0.0096) = 0.7167 ± 0.2266
    score = proportion([True] * 8 + [False] * 2)
    assert (score.value, score.count) == (0.8, 10)
    assert score.low == pytest.approx(0.4902, abs=2e-4)
    assert score.high == pytest.approx(0.9433, abs=2e-4)
    quiet = proportion([False] * 18)
    assert (quiet.value, quiet.low) == (0.0, 0.0)
    assert quiet.high == pytest.approx(0.1759, abs=2e-4), "nobody is certain after eighteen"
    assert proportion([]) == Score()


def test_the_bootstrap_of_a_mean_is_that_of_its_standard_error():
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    score = mean(list(values))
    assert score.value == pytest.approx(values.mean())
    width = 2 * 1.96 * values.std() / np.sqrt(400)
    assert score.high - score.low == pytest.approx(width, rel=0.1)
    assert mean([np.nan, 2.0, 4.0]).value == 3.0
    assert mean([]) == Score()
    assert bootstrapped(lambda weights: np.full(len(weights), np.nan), 3) == Score()


def test_f1_is_averaged_over_the_classes_that_occur():
    truth, answers = ["a", "a", "b", "c"], ["a", "b", "b", "d"]
    counts = confusion(truth, answers, ["a", "b", "c", "d"])
    np.testing.assert_array_equal(counts, [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
    # a: 2·1/(2+1), b: 2·1/(2+1), c: 0; d never occurs and does not count
    score = macro_f1(truth, answers)
    assert score.value == pytest.approx(4 / 9)
    assert score.low <= 4 / 9 <= score.high
    assert macro_f1([], []) == Score()


def test_calibration_by_hand():
    # 0.9 and 0.82 share a bin, in which 1 of 2 is right; 0.35 is alone and wrong
    np.testing.assert_array_equal(bin_of(np.array([0.9, 0.82, 0.35, 0.0, 1.0])), [8, 8, 3, 0, 9])
    score = calibration_error([0.9, 0.82, 0.35], [True, False, False])
    assert score.value == pytest.approx((abs(0.9 + 0.82 - 1) + 0.35) / 3)
    assert calibration_error([1.0, 1.0], [True, True]).value == 0.0
    assert brier([0.9, 0.5], [True, False]).value == pytest.approx((0.01 + 0.25) / 2)


def test_few_worlds_look_ill_calibrated_by_chance():
    # one world at 0.5 is off by a half, right or wrong; where p is 0 or 1 nothing is left to chance
    assert calibration_error_by_chance([0.5]) == Score(0.5, 0.5, 0.5, 1)
    assert calibration_error_by_chance([1.0, 0.0]).value == 0.0
    assert calibration_error_by_chance([]) == Score()
    # n of them in one bin: the mean of |binomial - n p| / n, which for large n is that of a normal variable
    many = calibration_error_by_chance([0.7] * 400)
    assert many.value == pytest.approx(np.sqrt(2 / np.pi * 0.7 * 0.3 / 400), rel=0.05)
    assert many.low < many.value < many.high


def test_area_under_the_curve_by_hand():
    positive = np.array([True, True, False, False])
    assert area_under(np.array([0.9, 0.8, 0.2, 0.1]), positive) == 1.0
    assert area_under(np.array([0.9, 0.2, 0.8, 0.1]), positive) == 0.75, "three pairs of four in order"
    assert area_under(np.zeros(4), positive) == 0.5
    assert area_under(np.array([0.5, 0.2, 0.5, 0.1]), positive) == pytest.approx((0.5 + 1 + 0 + 1) / 4)
    assert np.isnan(area_under(np.zeros(4), np.ones(4, bool)))


def test_overlap_by_hand():
    one, other = np.array([True, True, False, False]), np.array([True, False, True, False])
    assert overlap(one, other) == pytest.approx(1 / 3)
    assert np.isnan(overlap(~one & one, ~one & one))
    np.testing.assert_array_equal(acting(np.array([0.0, 0.1, 0.2, 0.4])), [False, False, True, True])
    assert not acting(np.zeros(3)).any()


def test_the_gap_is_closed_over_all_worlds_together():
    # (10 - 4) + (2 - 2) of (10 - 2) + (2 - 1) millimetres; the mean of fractions would be 0.375
    score = closed([0.010, 0.002], [0.004, 0.002], [0.002, 0.001])
    assert score.value == pytest.approx(6 / 9)
    assert (score.low, score.high) == pytest.approx((0.0, 0.75))
    assert closed([0.001], [0.001], [0.002]) == Score(), "nothing to reduce"
