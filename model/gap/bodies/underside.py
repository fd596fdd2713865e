"""What a solid lies on, where cameras have seen it from above alone.

A body of what is seen would fall or tip over, or sink in between its sides where these are seen down to the
ground: its underside is missing. What is at rest not far above the ground lies on it, below all of its top
under which nothing is seen: of a ring along its tube, of a doll along each limb. An underside that is round
is taken to be flat.
"""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from model.gap.bodies.falling import falls
from model.gap.bodies.neighbours import FOURTH, patch_normals, usual_distance
from model.gap.bodies.unheld import unheld
from model.gap.size import size_of
from model.types import Array, Observation

MOST, MOST_HELD = 0.55, 0.25
"""Of how high it reaches above the ground: what is less above it lies there, of a ball one sees nearly half.
What hangs from a hand may be in the air."""
ASIDE = 0.15
"""Of its size, and of its hands: what hangs at rest has its middle no farther from below them."""
NEAR, STEEP = 0.8, 0.25
"""Of that distance, and of a point's height above the ground: who is as near, seen from above, is above or
below it."""
BELOW = 0.5
"""Of its height: who is as low is of another side."""
AROUND, TOP = 2.0, 0.6
"""Times as far, and of what is highest there: who is less high is of a side."""
BARE = 0.1
"""Of what is seen, at least, has nothing below: of 80 recordings of solids that are seen all around 0.00 to
0.06, of 16 from above and aside 0.13 to 0.76."""
LEVEL, PATCH = 0.7, 7
"""Cosine of the slope of what is level, as told by so many points that are next to each other."""
APART, SHOWN = 2.0, 0.65
"""Of their usual distance: who is farther above or below is of another side. Of what is level, at least, lies
above or below another side where all of a solid is seen: of 13 recordings 0.62 to 1.00, of 12 of solids that
lie on the ground and are seen from above and aside 0.00 to 0.43."""


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
    bare = _bare(places, ground)
    if bare.mean() < BARE or _seen_from_below(places):
        return np.zeros((0, 3))
    below: Float64[Array, "U 3"] = places[bare]
    below[:, 2] = ground
    return below


def _bare(places: Float64[Array, "N 3"], ground: float) -> Bool[Array, " N"]:
    """Which are on its top, with nothing seen below them."""
    heights, tree = places[:, 2] - ground, cKDTree(places[:, :2])
    radii = np.maximum(NEAR * usual_distance(places, FOURTH), STEEP * heights)
    below = np.array([heights[each].min() for each in tree.query_ball_point(places[:, :2], radii)])
    top = np.array([heights[each].max() for each in tree.query_ball_point(places[:, :2], AROUND * radii)])
    return (below > BELOW * heights) & (heights > TOP * top)


def _seen_from_below(places: Float64[Array, "N 3"]) -> bool:
    """Whether an underside is seen, wherever it is: most of what is level has another side below or above."""
    apart = usual_distance(places, FOURTH)
    patches = places[cKDTree(places).query(places, k=min(PATCH, len(places)))[1]]
    level = np.abs(patch_normals(patches)[:, 2]) > LEVEL
    columns = cKDTree(places[:, :2]).query_ball_point(places[level, :2], NEAR * apart)
    other = [
        np.abs(places[near, 2] - height).max() > APART * apart
        for near, height in zip(columns, places[level, 2], strict=True)
    ]
    return len(other) > 0 and float(np.mean(other)) > SHOWN


def _lies(observation: Observation, places: Float64[Array, "N 3"], low: float, high: float) -> bool:
    """Whether it ends on the ground or not far above, and does not fall; from `low` to `high` [m] above."""
    most = MOST_HELD if _may_hang(observation, places) else MOST
    return low < most * high and not falls(observation)


def _may_hang(observation: Observation, places: Float64[Array, "N 3"]) -> bool:
    """Whether its middle is below or between its hands, as that of what hangs from them at rest."""
    hands = observation.controllers[0, :, :2].astype(np.float64)
    if not len(hands) or unheld(observation, places).all():
        return False
    middle = hands.mean(0)
    reach = float(np.linalg.norm(hands - middle, axis=1).max())
    aside = float(np.linalg.norm(places[:, :2].mean(0) - middle))
    return aside < reach + ASIDE * (reach + size_of(places))
