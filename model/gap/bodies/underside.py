"""What a solid lies on, where a camera has seen it from above alone.

Where what is seen of it ends above the ground, a body of that alone would fall, or tip over: its underside,
and all below its far side, are missing. What is at rest not far above the ground lies on it. Where its sides
are seen down to the ground, it would sink in between them.
"""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError, cKDTree

from model.gap.bodies.borne import unheld
from model.gap.bodies.neighbours import usual_distance
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
NEAR, APART = 2.0, 0.3
"""Usual distances: what is as near, seen from above, is above or below; of the height of what is seen: what
is lower by that is another side."""
TOP, BARE = 0.5, 0.1
"""Of the height of what is seen: its top is above. Of what is seen, at least, is top with nothing below: of
60 recordings of solids that are seen all around 0.00 to 0.02, of eight from above 0.13 to 0.28."""
SOON, FALLEN = 0.12, 0.3
"""After so long [s] what nothing bears is lower by more than such a share of a free fall."""


def underside(observation: Observation, places: Float64[Array, "N 3"]) -> Float64[Array, "U 3"]:
    """Points on the ground under a solid that lies there; none where it hangs or its underside is seen.

    Args:
        observation: Whose ground and hands count.
        places: Points on the object in the first frame [m].
    """
    ground = observation.ground_height
    if ground is None:
        return np.zeros((0, 3))
    low, high = (float(each) - ground for each in (places[:, 2].min(), places[:, 2].max()))
    if not _lies(observation, places, low, high):
        return np.zeros((0, 3))
    below = _within_outline(places) if low > LEAST * high else _under_top(places)
    return np.column_stack([below, np.full(len(below), ground)])


def _within_outline(places: Float64[Array, "N 3"]) -> Float64[Array, "U 2"]:
    """Of what ends above the ground: all but its rim, if nothing of an underside is seen."""
    try:
        outline = places[ConvexHull(places[:, :2]).vertices, :2]
    except QhullError:  # a plane that stands upright
        return np.zeros((0, 2))
    middle = (outline.min(0) + outline.max(0)) / 2
    sides = ConvexHull(middle + INNER * (outline - middle)).equations
    within = (places[:, :2] @ sides[:, :2].T + sides[:, 2] < 0.0).all(1)
    low, high = places[:, 2].min(), places[:, 2].max()
    if not within.any() or (places[within, 2] < low + LOW * (high - low)).any():
        return np.zeros((0, 2))
    below: Float64[Array, "U 2"] = middle + ROUND * (places[:, :2] - middle)
    return below


def _under_top(places: Float64[Array, "N 3"]) -> Float64[Array, "U 2"]:
    """Of what is seen down to the ground: below the places on its top under which nothing is seen."""
    heights = places[:, 2]
    low, high = heights.min(), heights.max()
    near = cKDTree(places[:, :2]).query_ball_point(places[:, :2], NEAR * usual_distance(places))
    lowest = np.array([heights[each].min() for each in near])
    bare = (lowest > heights - APART * (high - low)) & (heights > low + TOP * (high - low))
    return places[bare, :2].copy() if bare.mean() > BARE else np.zeros((0, 2))


def _lies(observation: Observation, places: Float64[Array, "N 3"], low: float, high: float) -> bool:
    """Whether it ends on the ground or not far above, and does not fall; from `low` to `high` [m] above."""
    most = MOST if unheld(observation, places).all() else MOST_HELD
    if not low < most * high:
        return False
    since = np.asarray(observation.times, np.float64) - observation.times[0]
    soon = min(int(np.searchsorted(since, SOON)), len(since) - 1)
    lower = observation.points[0, :, 2] - observation.points[soon, :, 2]
    both = lower[np.isfinite(lower)]
    falls = 0.5 * float(np.linalg.norm(observation.gravity)) * float(since[soon]) ** 2
    return len(both) == 0 or float(np.median(both)) < FALLEN * max(falls, 1e-12)
