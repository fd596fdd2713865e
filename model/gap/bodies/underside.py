"""What a solid lies on, where a camera has seen it from above alone.

What is seen of it ends above the ground, and a body of that alone would fall, or tip over: its underside, and
all below its far side, are missing. What is at rest not far above the ground lies on it.
"""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError

from model.gap.bodies.borne import unheld
from model.types import Array, Observation

LEAST = 0.02
"""Of how high it reaches above the ground: what is less above it is as good as on it."""
MOST, MOST_HELD = 0.55, 0.25
"""The same, of what lies there: of a ball one sees nearly half. What a hand holds may be in the air."""
INNER = 0.6
"""Of its outline as seen from above, counted from the middle: what is within is not its rim."""
LOW = 0.25
"""Of the height of what is seen: points that are as low, within the rim, are of an underside that is seen."""
ROUND = 0.8
"""Of its outline is what it lies on: of a box all, of a ball hardly anything. Six solids of another hand are
followed as closely with 0.6 and with 1."""
SOON, FALLEN = 0.12, 0.3
"""After so long [s] what nothing bears is lower by more than such a share of a free fall."""


def underside(observation: Observation, places: Float64[Array, "N 3"]) -> Float64[Array, "U 3"]:
    """Points on the ground under a solid that lies there; none where it is in the air or seen from below.

    Args:
        observation: Whose ground and hands count.
        places: Points on the object in the first frame [m].
    """
    nothing, ground = np.zeros((0, 3)), observation.ground_height
    if ground is None or not _lies(observation, places, ground):
        return nothing
    try:
        outline = places[ConvexHull(places[:, :2]).vertices, :2]
    except QhullError:  # a plane that stands upright
        return nothing
    middle = (outline.min(0) + outline.max(0)) / 2
    sides = ConvexHull(middle + INNER * (outline - middle)).equations
    within = (places[:, :2] @ sides[:, :2].T + sides[:, 2] < 0.0).all(1)
    low, high = places[:, 2].min(), places[:, 2].max()
    if not within.any() or (places[within, 2] < low + LOW * (high - low)).any():
        return nothing
    below = middle + ROUND * (places[:, :2] - middle)
    return np.column_stack([below, np.full(len(below), ground)])


def _lies(observation: Observation, places: Float64[Array, "N 3"], ground: float) -> bool:
    """Whether it ends above the ground, but not far, and does not fall."""
    low, high = (float(each) - ground for each in (places[:, 2].min(), places[:, 2].max()))
    most = MOST if unheld(observation, places).all() else MOST_HELD
    if not LEAST * high < low < most * high:
        return False
    since = np.asarray(observation.times, np.float64) - observation.times[0]
    soon = min(int(np.searchsorted(since, SOON)), len(since) - 1)
    lower = observation.points[0, :, 2] - observation.points[soon, :, 2]
    both = lower[np.isfinite(lower)]
    falls = 0.5 * float(np.linalg.norm(observation.gravity)) * float(since[soon]) ** 2
    return len(both) == 0 or float(np.median(both)) < FALLEN * max(falls, 1e-12)
