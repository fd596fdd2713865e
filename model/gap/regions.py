"""Parts of an object by names that a person understands, where none were labelled."""

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.bodies.body import Body
from model.gap.bodies.first import first_places
from model.types import Array, Observation

APART = 0.3
"""Of the object's length: a gap between hands as wide as that makes them hold it in two places."""
UPRIGHT = 0.7
"""An axis stands where it rises by more than this share of its length."""


def parts_of(observation: Observation, body: Body) -> tuple[tuple[str | int, ...], Int64[Array, " N"]]:
    """Names of the parts, and which of them each observed point belongs to.

    Labels where the observation has some; else thirds by the distance at rest from where it is held; else
    thirds of its length.

    Args:
        observation: What is seen.
        body: Its mass points, and which of them are held.
    """
    if observation.parts is not None:
        labels, index = np.unique(observation.parts, return_inverse=True)
        return tuple(int(label) for label in labels), index.astype(np.int64)
    places = first_places(observation)
    places = np.where(np.isfinite(places), places, np.nanmean(places, axis=0))
    names, away = _thirds(places, body)
    low, high = float(away.min()), float(away.max())
    third = np.floor(3.0 * (away - low) / max(high - low, 1e-9)).astype(np.int64).clip(0, 2)
    present, index = np.unique(third, return_inverse=True)
    return tuple(names[i] for i in present), index.astype(np.int64)


def _thirds(places: Float64[Array, "N 3"], body: Body) -> tuple[tuple[str, str, str], Float64[Array, " N"]]:
    """Names of the thirds, and the length that is divided into them."""
    centred = places - places.mean(0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    along: Float64[Array, " N"] = centred @ axis
    if len(body.grip):
        hands = body.points[np.unique(body.grip[:, 1])]
        away = np.linalg.norm(places[:, None] - hands[None], axis=-1).min(1)
        between = np.diff(np.sort((hands - places.mean(0)) @ axis), prepend=-np.inf)[1:]
        if (between > APART * np.ptp(along)).any():
            return ("near a grip", "farther from the grips", "farthest from the grips"), away
        return ("near the grip", "middle", "far end"), away
    if abs(axis[2]) > UPRIGHT:
        return ("bottom", "middle", "top"), along * np.sign(axis[2])
    # the end with the longer tail comes last, whichever way the axis points
    return ("one end", "middle", "other end"), along * (1.0 if (along**3).sum() >= 0 else -1.0)
