"""The scores of the withheld check, in numpy alone, each with a 95 % interval.

Shares of worlds have Wilson's interval: a bootstrap of eighteen quiet nulls out of eighteen would claim to be
certain. All others have percentile bootstrap intervals over worlds.

Reference:
    Wilson (1927), Probable inference, the law of succession, and statistical inference, JASA 22.
    Efron (1979), Bootstrap methods: another look at the jackknife, Annals of Statistics 7.
    Guo, Pleiss, Sun and Weinberger (2017), On calibration of modern neural networks, ICML (expected
    calibration error). Brier (1950), Verification of forecasts expressed in terms of probability.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from model.types import Array

Weights: TypeAlias = Float[Array, "resamples n"]
"""How often each of n worlds is drawn."""
Values: TypeAlias = Float[Array, " resamples"]
Z = 1.959964
"""Of a normal variable, 95 % two-sided."""
RESAMPLES = 2000
BINS = 10
"""Of confidence, for the calibration."""


@dataclass(frozen=True)
class Score:
    """A figure, its 95 % interval and how many worlds it is of; all None or 0 where there is none."""

    value: float | None = None
    low: float | None = None
    high: float | None = None
    count: int = 0


def proportion(right: Sequence[bool]) -> Score:
    """Share of the worlds in which something holds, with Wilson's interval."""
    n = len(right)
    if n == 0:
        return Score()
    p = float(np.mean(right))
    middle = (p + Z**2 / (2 * n)) / (1 + Z**2 / n)
    half = Z / (1 + Z**2 / n) * float(np.sqrt(p * (1 - p) / n + Z**2 / (4 * n**2)))
    return Score(p, min(max(middle - half, 0.0), p), max(min(middle + half, 1.0), p), n)


def bootstrapped(statistic: Callable[[Weights], Values], count: int) -> Score:
    """A statistic of worlds with its percentile interval.

    Args:
        statistic: Of how often each world is drawn, once for each resample; NaN where it is not defined.
        count: How many worlds there are.
    """
    if count == 0:
        return Score()
    value = float(statistic(np.ones((1, count)))[0])
    if np.isnan(value):
        return Score()
    rng = np.random.default_rng(0)
    drawn = statistic(rng.multinomial(count, np.full(count, 1 / count), RESAMPLES).astype(float))
    low, high = np.nanpercentile(drawn, [2.5, 97.5])
    return Score(value, float(low), float(high), count)


def mean(values: Sequence[float]) -> Score:
    """The mean over worlds, without those where the value is NaN."""
    known = np.array([value for value in values if not np.isnan(value)], float)
    return bootstrapped(lambda weights: weights @ known / len(known), len(known))


def confusion(
    truth: Sequence[str], answers: Sequence[str], classes: Sequence[str]
) -> Int[Array, "truth answers"]:
    """Counts by true class (rows) and answer (columns)."""
    counts: Int[Array, "truth answers"] = np.zeros((len(classes), len(classes)), int)
    np.add.at(counts, (_indices(truth, classes), _indices(answers, classes)), 1)
    return counts


def macro_f1(truth: Sequence[str], answers: Sequence[str]) -> Score:
    """F1 = 2 TP / (2 TP + FP + FN) of each class that occurs in truth, averaged over those."""
    classes = sorted({*truth, *answers})
    true, said = (np.eye(len(classes))[_indices(names, classes)] for names in (truth, answers))

    def averaged(weights: Weights) -> Values:
        there, hit = weights @ true, weights @ (true * said)
        either = np.maximum(there + weights @ said, 1.0)
        occurring = (there > 0).sum(axis=1)
        total: Values = np.where(there > 0, 2 * hit / either, 0.0).sum(axis=1) / occurring
        return total

    return bootstrapped(averaged, len(truth))


def _indices(names: Sequence[str], classes: Sequence[str]) -> Int[Array, " n"]:
    return np.array([classes.index(name) for name in names], int)


def calibration_error(confidence: Sequence[float], right: Sequence[bool]) -> Score:
    """Expected calibration error of the probability of the answer."""
    p, hit = np.array(confidence, float), np.array(right, float)
    apart = np.eye(BINS)[bin_of(p)] * (p - hit)[:, None]
    return bootstrapped(lambda weights: np.abs(weights @ apart).sum(axis=1) / len(p), len(p))


def calibration_error_by_chance(confidence: Sequence[float]) -> Score:
    """What `calibration_error` would be were all probabilities right: its mean and where 95 % of draws are.

    Of few worlds it is far from zero, since in no bin the share that is right is exactly what it should be.

    Reference:
        Bröcker and Smith (2007), Increasing the reliability of reliability diagrams, Weather and forecasting
        22 (consistency resampling).
    """
    p = np.array(confidence, float)
    if not len(p):
        return Score()
    hit = np.random.default_rng(0).random((RESAMPLES, len(p))) < p
    drawn = np.abs((p - hit) @ np.eye(BINS)[bin_of(p)]).sum(axis=1) / len(p)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Score(float(drawn.mean()), float(low), float(high), len(p))


def bin_of(confidence: Float[Array, " n"]) -> Int[Array, " n"]:
    """Which of `BINS` equal parts of 0..1 each confidence is in; one that ends a part belongs to it."""
    bins: Int[Array, " n"] = np.clip(np.ceil(confidence * BINS).astype(int) - 1, 0, BINS - 1)
    return bins


def brier(confidence: Sequence[float], right: Sequence[bool]) -> Score:
    """Mean square of probability of the answer less whether it is right."""
    return mean(list((np.array(confidence, float) - np.array(right, float)) ** 2))


def area_under(strength: Float[Array, " N"], positive: Bool[Array, " N"]) -> float:
    """Area under the receiver operating characteristic; ties count half, NaN where one side is empty."""
    above, below = int(positive.sum()), int((~positive).sum())
    if not above or not below:
        return float("nan")
    _, inverse, counts = np.unique(strength, return_inverse=True, return_counts=True)
    rank = (np.cumsum(counts) - (counts - 1) / 2)[inverse]
    return float((rank[positive].sum() - above * (above + 1) / 2) / (above * below))


def overlap(one: Bool[Array, " N"], other: Bool[Array, " N"]) -> float:
    """Intersection over union; NaN where both are empty."""
    either = int((one | other).sum())
    return float((one & other).sum() / either) if either else float("nan")


def acting(strength: Float[Array, " N"]) -> Bool[Array, " N"]:
    """Where an effect acts: with at least half of its greatest strength."""
    where: Bool[Array, " N"] = (strength >= 0.5 * strength.max()) & (strength > 0)
    return where


def closed(refit: Sequence[float], with_effect: Sequence[float], noise_floor: Sequence[float]) -> Score:
    """Share of the reducible gap that is closed, over all worlds together.

    A mean of fractions would hang on the worlds that have next to no gap.
    """
    before, after, floor = (np.array(each, float) for each in (refit, with_effect, noise_floor))

    def share(weights: Weights) -> Values:
        reducible = weights @ (before - floor)
        closed: Values = weights @ (before - after) / np.where(reducible > 0, reducible, np.nan)
        return closed

    return bootstrapped(share, len(before))
