"""When an object is let go that something unseen has held still."""

import numpy as np
from jaxtyping import Float64

from model.gap.bodies.frames import frames_of
from model.gap.noise import noise_of
from model.types import Array, Observation

HELD = 0.1
"""Seconds of stillness, at least, before it can be said that something ended them."""
AFTER = 0.1
"""Seconds that are looked at after them."""
NOISY = 6.0
"""Standard deviations of the noise: what moves less is still."""
FALL = 0.3
"""Of gravity: who is let go falls at first at least so fast."""
MOVED = 0.1
"""A hand that moves by more than this share of what the object does may be what moves it."""
FEWEST = 3
"""Frames after it in which a fall is told."""


def let_go(observation: Observation) -> int:
    """The last frame in which something that is no controller held the object; 0: nothing did.

    An object that is still, and then falls at once though no controller moves, was held by a finger, a string
    or a stop that the recording does not know of. No twin can be at rest there and fall after it.

    Args:
        observation: Within its contract.
    """
    times = observation.times
    limit = NOISY * noise_of(observation)
    away = _farthest(observation.points.astype(np.float64))
    # one of many points in many frames is noisier than that now and then: what moves stays away
    gone = np.lib.stride_tricks.sliding_window_view(away > limit, min(FEWEST, len(away))).all(1)
    last = int(gone.argmax()) - 1
    # however far apart frames are: at 25 a second, or at 29.97, no three follow within that time
    end = max(int(np.searchsorted(times, times[last] + AFTER, side="right")), last + FEWEST + 1)
    if last < 1 or times[last] - times[0] < HELD or end >= len(times):
        return 0
    hand = _farthest(observation.controllers.astype(np.float64))[:end].max()
    if hand > max(limit, MOVED * float(away[:end].max())):
        return 0
    return last if _falls(observation, last, end, limit) else 0


def after_let_go(observation: Observation) -> Observation:
    """The recording from when the object is let go on; as it is where nothing unseen holds it."""
    return frames_of(observation, slice(let_go(observation), None))


def _farthest(places: Float64[Array, "T n 3"]) -> Float64[Array, " T"]:
    """How far from its first place the farthest is that is seen [m]; 0 where nothing is."""
    if not places.shape[1]:
        return np.zeros(len(places))
    away: Float64[Array, " T"] = np.nan_to_num(np.linalg.norm(places - places[0], axis=-1)).max(1)
    return away


def _falls(observation: Observation, last: int, end: int, limit: float) -> bool:
    """Whether what moves most falls in the frames after the last still one, farther than noise looks."""
    gravity = np.asarray(observation.gravity, np.float64)
    pull = float(np.linalg.norm(gravity))
    known = np.isfinite(observation.points[: last + 1, :, 0]).any(0)
    if pull == 0.0 or not known.any():
        return False
    points = observation.points[:, known].astype(np.float64)
    before = np.nanmedian(points[: last + 1], axis=0)  # it was still: one frame alone has all its noise
    fallen: Float64[Array, "t n"] = (points[last:end] - before) @ (gravity / pull)
    lowest = np.nan_to_num(fallen, nan=-np.inf).max(1)
    spent = observation.times[last:end] - observation.times[last]
    few = slice(1, FEWEST + 1)
    # it is let go somewhere between two frames: of all that begin then, the fall is told by the fastest
    needed = 0.5 * FALL * pull * spent[few] ** 2
    return bool((lowest[few] > needed).all() and lowest[-1] > limit)
