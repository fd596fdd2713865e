"""How sure a spread is: what it is without each of the objects.

A bootstrap draws objects twice, whose values are then not apart at all: it makes spreads too small.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import t as student

from model.evaluation.bootstrap import FEWEST, LEVEL, Group, Interval


def spread_interval(groups: Sequence[Group], spread: Callable[[Sequence[Group]], float]) -> Interval | None:
    """A spread of groups and its interval, from the jackknife of its logarithm.

    Args:
        groups: One per object.
        spread: More than zero; NaN where groups say nothing, without which of them does not count.

    Returns:
        None without groups, or where the spread of all of them is NaN.

    Reference:
        Miller (1974), The jackknife: a review, Biometrika 61 (of the logarithm of a variance).
    """
    value = spread(groups) if groups else float("nan")
    if not np.isfinite(value):
        return None
    without = np.array([spread([*groups[:k], *groups[k + 1 :]]) for k in range(len(groups))])
    without = without[np.isfinite(without) & (without > 0.0)]
    count = len(without)
    if count < FEWEST or value <= 0.0:
        return Interval(value, None, None, len(groups))
    error = float(np.sqrt((count - 1) * np.var(np.log(without))))
    reach = float(np.exp(student.ppf(0.5 + LEVEL / 2.0, count - 1) * error))
    return Interval(value, value / reach, value * reach, len(groups))
