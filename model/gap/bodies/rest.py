"""Where the points of an object are in the first frame, told by all frames."""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.first import first_places
from model.gap.bodies.turns import nearest_rotation
from model.gap.noise import noise_of
from model.types import Array, Observation

FRIENDS = 8
"""Points that a point is told by."""
CANDIDATES = 30
"""Points, the nearest ones, of which these are taken."""
FRAMES = 160
"""Frames that are asked, at most."""
LOYAL = 3.0
"""Friends are near, and stay as far as they are: a spread of the distance counts so much more than itself."""
STIFFER = 2.0
"""By how much more than the noise the change of a neighbourhood's shape makes a frame count less."""
FARTHEST = 3.0
"""Standard deviations of the noise: what was seen in the first frame is not farther from there."""


def rest_places(observation: Observation) -> Float64[Array, "N 3"]:
    """Where each point is in the first frame [m]; NaN for one that is never seen.

    One frame has the noise of one frame, and a hand hides what it holds. But a point goes along with its
    neighbours, and with the hand that holds it: each frame in which they are seen tells where it was among
    them. What a frame says counts the more, the less the neighbourhood has changed its shape by then. Nothing
    is below the ground, wherever neighbours that were lifted and turned say that it was.

    Args:
        observation: What was seen.
    """
    taken = np.unique(np.linspace(0, len(observation.times) - 1, FRAMES).round().astype(int))
    points = observation.points[taken].astype(np.float64)
    controllers = observation.controllers[taken].astype(np.float64)
    known = np.isfinite(points[..., 0]).any(0)
    places, noise = first_places(observation), noise_of(observation)
    if known.sum() <= FRIENDS:
        return places
    at_first = np.isfinite(points[0, :, 0])
    moving = np.concatenate([points, controllers], axis=1)
    seen = np.isfinite(moving[..., 0])
    sure = np.concatenate([at_first, np.ones(controllers.shape[1], bool)])
    for believed in (sure, np.concatenate([known, sure[len(known) :]])):
        told = np.concatenate([places, controllers[0]])
        moved = places.copy()
        for i in np.flatnonzero(known):
            friends = _friends(int(i), moving, seen, believed)
            if len(friends) >= 3:
                moved[i] = _told(told[friends], moving[:, friends], seen[:, friends], moving[:, i], noise)
        places = moved
        away = places[at_first] - points[0, at_first]
        length = np.linalg.norm(away, axis=1, keepdims=True)
        places[at_first] -= away * (1.0 - np.minimum(1.0, FARTHEST * noise / np.maximum(length, 1e-12)))
        if observation.ground_height is not None:
            places[~at_first, 2] = np.maximum(places[~at_first, 2], observation.ground_height)
    return places


def _friends(
    i: int, moving: Float64[Array, "T M 3"], seen: Bool[Array, "T M"], believed: Bool[Array, " M"]
) -> Int64[Array, " f"]:
    """Those that are near to point i and stay as far from it as they are."""
    frame = int(seen[:, i].argmax())
    others: Int64[Array, " o"] = np.flatnonzero(believed & seen[frame]).astype(np.int64)
    others = others[others != i]
    if not len(others):
        return others
    count = min(CANDIDATES, len(others))
    nearest = cKDTree(moving[frame, others]).query(moving[frame, i], k=count)[1]
    near: Int64[Array, " c"] = others[np.atleast_1d(nearest)]
    distance = np.linalg.norm(moving[:, near] - moving[:, i, None], axis=-1)
    distance[~(seen[:, near] & seen[:, i, None])] = np.nan
    middle = np.nanmedian(distance, 0)
    order = np.argsort(middle + LOYAL * np.nanstd(distance, 0), kind="stable")[:FRIENDS]
    friends: Int64[Array, " f"] = near[order]
    return friends


def _told(
    places: Float64[Array, "f 3"],
    moving: Float64[Array, "T f 3"],
    seen: Bool[Array, "T f"],
    point: Float64[Array, "T 3"],
    noise: float,
) -> Float64[Array, "3"]:
    """Where a point was, by friends that were in `places`: their turn and shift undone, frame by frame."""
    used = np.isfinite(point[:, 0]) & (seen.sum(1) >= 3)
    if not used.any():
        used = np.isfinite(point[:, 0])
    weight = seen[used].astype(np.float64)[..., None]
    now, here = np.nan_to_num(moving[used]), point[used]
    count = np.maximum(weight.sum(1, keepdims=True), 1.0)
    before_middle = (weight * places).sum(1, keepdims=True) / count
    now_middle = (weight * now).sum(1, keepdims=True) / count
    before, after = weight * (places - before_middle), weight * (now - now_middle)
    turn = nearest_rotation(before.swapaxes(1, 2) @ after)  # of row vectors, from then to now
    change = (((after - before @ turn) ** 2).sum((1, 2))) / (3.0 * count[:, 0, 0])
    back = before_middle[:, 0] + ((here - now_middle[:, 0])[:, None] @ turn.swapaxes(1, 2))[:, 0]
    trust = 1.0 / (noise**2 + STIFFER**2 * np.maximum(change - noise**2, 0.0))
    place: Float64[Array, 3] = (trust[:, None] * back).sum(0) / trust.sum()
    return place
