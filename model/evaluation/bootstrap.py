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
FEWEST = 5
"""Objects. Fewer hardly differ between draws: one alone would be certain, and any difference decided."""
Group = TypeVar("Group")


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % interval; without, where fewer than `FEWEST` objects tell how sure it is."""

    value: float
    low: float | None
    high: float | None
    objects: int
    """That it rests on."""

    def of_each(self, function: Callable[[float], float]) -> "Interval":
        """The same by another measure, which rises with this one."""
        low, high = (None if end is None else function(end) for end in (self.low, self.high))
        return Interval(function(self.value), low, high, self.objects)

    def scaled(self, factor: float) -> "Interval":
        """The same in another unit; `factor` is positive."""
        return self.of_each(lambda value: value * factor)

    def shown(self, digits: int) -> str:
        """As `1.0 [0.8, 1.3]`; without an interval the value alone."""
        value = f"{self.value:.{digits}f}"
        if self.low is None or self.high is None:
            return value
        return f"{value} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


def interval(
    groups: Sequence[Group], statistic: Callable[[Sequence[Group]], float], seed: int = 0
) -> Interval | None:
    """A statistic of groups and its percentile interval over draws of groups with replacement.

    Not for spreads, which groups that were drawn twice make too small: see `model/evaluation/jackknife.py`.

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
    if objects < FEWEST or not len(known):
        return Interval(value, None, None, objects)
    tail = (1.0 - LEVEL) / 2.0
    low, high = np.quantile(known, [tail, 1.0 - tail])
    return Interval(value, float(low), float(high), objects)
