"""Whether an object falls from the first frame on, so that it is not at rest there."""

import numpy as np

from model.types import Observation

SOON, FALLEN = 0.12, 0.3
"""After so long [s] what nothing bears is lower by more than such a share of a free fall."""


def falls(observation: Observation) -> bool:
    """Whether half of what is seen sinks soon about as fast as what is let go.

    Args:
        observation: Within its contract.
    """
    since = np.asarray(observation.times, np.float64) - observation.times[0]
    soon = min(int(np.searchsorted(since, SOON)), len(since) - 1)
    lower = observation.points[0, :, 2] - observation.points[soon, :, 2]
    both = lower[np.isfinite(lower)]
    free = 0.5 * float(np.linalg.norm(observation.gravity)) * float(since[soon]) ** 2
    return len(both) > 0 and float(np.median(both)) >= FALLEN * max(free, 1e-12)
