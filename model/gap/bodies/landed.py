"""What a solid lies on once it has fallen, brought back to where that is in the first frame.

In the air nothing says how thick an object is that cameras see from one side: it is taken for what lies
behind the points that are seen, and rests on other points than it does when it is down. There its underside
is known.
"""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.gap.bodies.falling import falls
from model.gap.bodies.frames import frames_of
from model.gap.bodies.rest import rest_places
from model.gap.bodies.turns import nearest_rotation
from model.gap.bodies.underside import underside
from model.gap.noise import noise_of
from model.gap.size import size_of
from model.types import Array, Observation

STILL = 0.2
"""What lies hardly moves for so long [s]."""
HARDLY, NOISES = 0.01, 3.0
"""Of its size, or so many standard deviations of the noise, by which the usual point may move meanwhile."""
FRIENDS = 12
"""Points, the nearest ones, by which a place is carried from one frame to another; fewer tell nothing."""


def landed(observation: Observation, seen: Float64[Array, "N 3"]) -> Float64[Array, "U 3"]:
    """Points on the underside of a solid that falls, in the first frame [m]; none where none is missing.

    Args:
        observation: What was seen.
        seen: Where each point is in the first frame [m]; NaN for one that is never seen.
    """
    none: Float64[Array, "U 3"] = np.zeros((0, 3))
    if observation.ground_height is None or not falls(observation):
        return none
    frame = _lying(observation, seen)
    if frame is None:
        return none
    later = frames_of(observation, slice(frame, None))
    there = rest_places(later)
    known, both = np.isfinite(seen[:, 0]), np.isfinite(there[:, 0] + seen[:, 0])
    if both.sum() < FRIENDS:
        return none
    lost = known & ~both
    there[lost] = carried(seen[lost], seen[both], there[both])
    return carried(underside(later, there[known]), there[both], seen[both])


def _lying(observation: Observation, seen: Float64[Array, "N 3"]) -> int | None:
    """The first frame from which on it lies; None: it never does."""
    since = observation.times - observation.times[0]
    span = max(int(np.searchsorted(since, STILL)), 1)
    points = observation.points.astype(np.float64)
    away = np.linalg.norm(points[span:] - points[:-span], axis=-1)
    least = max(NOISES * noise_of(observation), HARDLY * size_of(seen[np.isfinite(seen[:, 0])]))
    for frame, each in enumerate(away):
        told = each[np.isfinite(each)]
        if len(told) and float(np.median(told)) < least:
            return frame
    return None


def carried(
    places: Float64[Array, "U 3"], here: Float64[Array, "M 3"], there: Float64[Array, "M 3"]
) -> Float64[Array, "U 3"]:
    """Places that turn and shift as the points nearest to them do, from `here` to `there` [m]."""
    if not len(places):
        return places
    near = cKDTree(here).query(places, k=min(FRIENDS, len(here)))[1]
    before, after = here[near], there[near]
    one, other = before.mean(1, keepdims=True), after.mean(1, keepdims=True)
    turns = nearest_rotation((before - one).swapaxes(1, 2) @ (after - other))  # of row vectors
    moved: Float64[Array, "U 3"] = (other + (places[:, None] - one) @ turns)[:, 0]
    return moved
