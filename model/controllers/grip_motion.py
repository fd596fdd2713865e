"""How a grip moves in the image: from tracks on the fingers and on the object beside them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Float64
from scipy.signal import savgol_filter

from model.controllers.contact import grown, touch_distance
from model.types import Array, Frames, Masks, Tracks

Track: TypeAlias = Callable[[Frames, Float32[Array, "N 2"], int], Tracks]
"""A tracker: follows pixels given on one frame."""

WINDOW = 12
"""Frames after which the tracks are renewed: fingers turn out of sight."""
_FEWEST = 5
"""With fewer tracks in agreement the mask decides."""
_AGREE = 2.5
"""How far a track may be from the common motion [px]."""
_SEARCH = 20
"""How far from a grip its border is looked for, over the touch distance."""
_SMOOTH, _ORDER = 9, 2
"""Savitzky-Golay window [frames] and order: symmetric, so that nothing lags."""


@dataclass(frozen=True)
class GripPath:
    """A grip in the image, from a start frame to the end of the clip."""

    position: Float64[Array, "T 2"]
    """[px]."""
    angle: Float64[Array, " T"]
    """Turn in the image since the start [rad]."""
    tracked: Bool[Array, " T"]
    """Whether tracks fixed it; else the masks."""
    touching: Bool[Array, " T"]
    """Whether it lies between the hand and the object."""


def follow_grip(
    frames: Frames,
    masks: Masks,
    start: int,
    anchor: Float64[Array, " 2"],
    radius: float,
    tracker: Track,
) -> GripPath:
    """Follow the place where a hand holds the object.

    Pixels of the hand and of the object within `radius` are tracked for `WINDOW` frames, then renewed.
    In each frame a robust rotation and translation carries the grip on; where too few tracks agree it
    moves to the nearest place between hand and object. A grip that leaves the border of hand and object is
    pulled back to it. At the end positions are smoothed, without lag.

    Args:
        frames: The clip.
        masks: Object and hand.
        start: The frame of `anchor`.
        anchor: The grip on the start frame [px].
        radius: How far around it tracks may lie [px].
        tracker: Follows pixels.
    """
    count = len(frames.images) - start
    position, angle = np.tile(anchor, (count, 1)), np.zeros(count)
    tracked, touching = np.ones(count, bool), np.ones(count, bool)
    for first in range(0, count - 1, WINDOW):
        last = min(first + WINDOW, count - 1)
        window = slice(start + first, start + last + 1)
        queries = _queries(masks, start + first, position[first], radius)
        clip = Frames(frames.images[window], frames.times[window], frames.name, frames.sha256)
        tracks = tracker(clip, queries, 0)
        for index in range(first + 1, last + 1):
            step = index - first
            move = _common_motion(tracks, step, position[first])
            tracked[index] = move is not None
            if move is not None:
                position[index], angle[index] = move[0], angle[first] + move[1]
            else:
                position[index], angle[index] = position[index - 1], angle[index - 1]
            frame = start + index
            position[index], touching[index] = _to_border(
                masks.object[frame], masks.hand[frame], position[index], bool(tracked[index])
            )
    return GripPath(smoothed(position), smoothed(angle[:, None])[:, 0], tracked, touching)


def follow_back(
    frames: Frames,
    masks: Masks,
    start: int,
    anchor: Float64[Array, " 2"],
    radius: float,
    tracker: Track,
) -> GripPath:
    """Where the place that is touched on frame `start` was before, from the keyframe to `start`.

    Nobody holds it yet, so only pixels of the object are followed; the median of what is seen counts.
    """
    window = slice(masks.keyframe, start + 1)
    count = start + 1 - masks.keyframe
    clip = Frames(frames.images[window], frames.times[window], frames.name, frames.sha256)
    tracks = tracker(clip, _spread(masks.object[start], anchor, radius, 40), count - 1)
    position, tracked = np.tile(anchor, (count, 1)), np.ones(count, bool)
    for index in range(count - 2, -1, -1):
        seen = tracks.visible[index]
        tracked[index] = seen.sum() >= _FEWEST
        shift = np.median(tracks.points[index, seen] - tracks.points[-1, seen], axis=0) if seen.any() else 0.0
        position[index] = anchor + shift if tracked[index] else position[index + 1]
    return GripPath(smoothed(position[::-1])[::-1].copy(), np.zeros(count), tracked, np.ones(count, bool))


def joined(before: GripPath, after: GripPath) -> GripPath:
    """One path of two; the last frame of the first is the first of the second."""
    return GripPath(
        np.concatenate([before.position[:-1], after.position]),
        np.concatenate([before.angle[:-1], after.angle]),
        np.concatenate([before.tracked[:-1], after.tracked]),
        np.concatenate([before.touching[:-1], after.touching]),
    )


def smoothed(values: Float[Array, "T n"]) -> Float64[Array, "T n"]:
    """Savitzky-Golay in time; the first row stays what it is."""
    window = min(_SMOOTH, len(values) - 1 + len(values) % 2)
    if window <= _ORDER:
        return np.asarray(values, np.float64)
    smooth = savgol_filter(values, window, _ORDER, axis=0, mode="interp")
    # the start is the rest state: what smoothing would move it by fades out over one window
    fade = np.clip(1.0 - np.arange(len(values)) / window, 0.0, 1.0)[:, None]
    return np.asarray(smooth + fade * (values[0] - smooth[0]), np.float64)


def _queries(masks: Masks, frame: int, grip: Float64[Array, " 2"], radius: float) -> Float32[Array, "N 2"]:
    """Pixels to follow around the grip: on the hand first of all, it is what moves the object."""
    fingers = _spread(masks.hand[frame], grip, 1.5 * radius, 40)
    beside = _spread(masks.object[frame], grip, radius, 30)
    return np.asarray(np.concatenate([fingers, beside]), np.float32)


def _spread(
    mask: Bool[Array, "H W"], centre: Float64[Array, " 2"], radius: float, count: int
) -> Float32[Array, "N 2"]:
    """Up to `count` pixels of the mask around a centre, far from each other and from its border."""
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    pixels = np.argwhere(inner)[:, ::-1].astype(np.float32)
    pixels = pixels[((pixels - centre) ** 2).sum(axis=1) < radius**2]
    if len(pixels) <= count:
        return np.asarray(pixels, np.float32)
    chosen = [int(np.argmin(((pixels - centre) ** 2).sum(axis=1)))]
    distance = ((pixels - pixels[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((pixels - pixels[chosen[-1]]) ** 2).sum(axis=1))
    return np.asarray(pixels[chosen], np.float32)


def _common_motion(
    tracks: Tracks, step: int, grip: Float64[Array, " 2"]
) -> tuple[Float64[Array, " 2"], float] | None:
    """Where the grip goes in `step` frames and how much it turns; None: too few tracks agree."""
    seen = tracks.visible[step]
    before, after = tracks.points[0, seen].astype(np.float64), tracks.points[step, seen].astype(np.float64)
    if len(before) < _FEWEST:
        return None
    cv2.setRNGSeed(0)
    found, inlier = cv2.estimateAffinePartial2D(
        before, after, method=cv2.RANSAC, ransacReprojThreshold=_AGREE, maxIters=500, confidence=0.995
    )
    if found is None or inlier.sum() < max(_FEWEST, 0.25 * len(before)):
        return None
    turn = float(np.arctan2(found[1, 0], found[0, 0]))
    return np.asarray(found[:, :2] @ grip + found[:, 2], np.float64), turn


def _to_border(
    object_mask: Bool[Array, "H W"], hand_mask: Bool[Array, "H W"], grip: Float64[Array, " 2"], tracked: bool
) -> tuple[Float64[Array, " 2"], bool]:
    """The grip, or the nearest place near both hand and object; and whether there is one.

    A tracked grip may leave the border a little before it is pulled back; another goes there.
    """
    reach = touch_distance(object_mask)
    low = np.maximum(np.floor(grip).astype(int) - _SEARCH * reach, 0)
    high = np.maximum(np.ceil(grip).astype(int) + _SEARCH * reach, low + 1)
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    between = grown(hand_mask[window], reach) & grown(object_mask[window], reach)
    places = np.argwhere(between)[:, ::-1] + low
    if len(places) == 0:
        return grip, False
    offset = places - grip
    nearest = offset[np.argmin((offset**2).sum(axis=1))]
    away = float(np.linalg.norm(nearest))
    slack = 2.0 * reach if tracked else 0.0
    return (grip, True) if away <= slack else (grip + nearest * (1.0 - slack / away), True)
