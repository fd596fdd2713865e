"""How sure a figure is: percentile bootstrap over objects.

Frames of a clip, and clips of an object, are no independent witnesses: what is drawn anew are objects.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from jaxtyping import Float64

from model.types import Array

DRAWS = 1000
LEVEL = 0.95
Group = TypeVar("Group")


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float
    objects: int
    """That it rests on."""

    def scaled(self, factor: float) -> "Interval":
        """The same in another unit; `factor` is positive."""
        return Interval(self.value * factor, self.low * factor, self.high * factor, self.objects)


def interval(
    groups: Sequence[Group], statistic: Callable[[Sequence[Group]], float], seed: int = 0
) -> Interval | None:
    """A statistic of groups and its percentile interval over draws of groups with replacement.

    Args:
        groups: One per object.
        statistic: May be NaN where a draw says nothing; such draws do not count.
        seed: Of the draws.

    Returns:
        None without groups, or where the statistic of all of them is NaN.
    """
    value = statistic(groups) if groups else float("nan")
    if not np.isfinite(value):
        return None
    rng = np.random.default_rng(seed)
    draws = [
        statistic([groups[k] for k in chosen])
        for chosen in rng.integers(0, len(groups), (DRAWS, len(groups)))
    ]
    return _percentiles(value, np.array(draws), len(groups))


def mean_interval(values: Mapping[str, Sequence[float]], seed: int = 0) -> Interval | None:
    """Mean over objects of the mean of each object's values; None without objects.

    Args:
        values: By object; each has at least one.
        seed: Of the draws: equal sets of objects are drawn alike.
    """
    means = np.array([float(np.mean(values[name])) for name in sorted(values)])
    if not len(means):
        return None
    rng = np.random.default_rng(seed)
    draws = means[rng.integers(0, len(means), (DRAWS, len(means)))].mean(axis=1)
    return _percentiles(float(means.mean()), draws, len(means))


def mean_difference(
    first: Mapping[tuple[str, str], float], second: Mapping[tuple[str, str], float], seed: int = 0
) -> Interval | None:
    """Mean over objects of second - first, over the cases that both have: a paired comparison.

    Args:
        first: By object and case.
        second: Likewise.
        seed: Of the draws.
    """
    pairs: dict[str, list[float]] = {}
    for key in sorted(first.keys() & second.keys()):
        pairs.setdefault(key[0], []).append(second[key] - first[key])
    return mean_interval(pairs, seed)


def _percentiles(value: float, draws: Float64[Array, " n"], objects: int) -> Interval:
    known = draws[np.isfinite(draws)]
    tail = (1.0 - LEVEL) / 2.0
    low, high = np.quantile(known, [tail, 1.0 - tail]) if len(known) else (value, value)
    return Interval(value, float(low), float(high), objects)
