"""A clip of any frame rate, as it would have been filmed at the one that motion is described at."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float32, Float64

from model.encoders.motion import MotionClip, ReferenceMotion
from model.types import Array

FRAME_RATE = 30.0
"""[1/s]: of the clips that the shipped network learned from."""
ALIKE = 0.02
"""Frames that come by this share early or late are those of `FRAME_RATE`."""
SAME = 1e-6
"""An instant this near to a frame, in frames, is that frame."""


def at_frame_rate(clip: MotionClip, references: ReferenceMotion) -> tuple[MotionClip, ReferenceMotion]:
    """What was seen in the frames that references have, and these, `FRAME_RATE` times a second.

    What changes from frame to frame, a speed or a jerk, is read by frames: of a film of 60 frames a second or
    of seven it would be another quantity. Ways between frames are cubic, their speeds at a frame
    those from the frame before it to the one after; a point is seen where it is in both frames. The
    pictures stay behind, they cannot be filmed anew. A clip of `FRAME_RATE` stays as it is.

    Args:
        clip: Of any frame rate; times ascend.
        references: As many frames as are compared, from the first on.
    """
    times = clip.times[: len(references.base)]
    if (np.abs(np.diff(times) * FRAME_RATE - 1.0) <= ALIKE).all():
        return clip, references
    count = int(np.floor((times[-1] - times[0]) * FRAME_RATE + SAME)) + 1
    instants = times[0] + np.arange(count) / FRAME_RATE
    frames = len(times)
    resampled = replace(
        clip,
        times=instants,
        points=_between(times, instants, clip.points[:frames]),
        controllers=_between(times, instants, clip.controllers[:frames]),
        images=None,
    )
    return resampled, replace(
        references,
        sweep=np.stack([_between(times, instants, one) for one in references.sweep]),
        base=_between(times, instants, references.base),
        varied=np.stack([_between(times, instants, one) for one in references.varied]),
    )


def _between(
    times: Float64[Array, " T"], instants: Float64[Array, " U"], values: Float[Array, "T n 3"]
) -> Float32[Array, "U n 3"]:
    """Values at other instants (Hermite's cubics); NaN next to NaN, but where an instant is a frame."""
    before = np.clip(np.searchsorted(times, instants, side="right") - 1, 0, len(times) - 2)
    length = times[before + 1] - times[before]
    share = (instants - times[before]) / length
    share = np.where(np.abs(share - share.round()) < SAME, share.round(), share)[:, None, None]
    places = values.astype(np.float64)
    chord = places[before + 1] - places[before]
    speed = np.gradient(places, times, axis=0)
    # next to a gap a speed is not known: that of the straight way then
    start, end = (
        np.where(np.isfinite(slope), slope, chord)
        for slope in length[:, None, None] * speed[[before, before + 1]]
    )
    turned = share * (1.0 - share) * ((1.0 - share) * (start - chord) - share * (end - chord))
    way = places[before] + share * chord + turned
    # 0 times NaN is NaN: a frame next to one in which nothing was seen is still itself
    exact = np.where(share == 0.0, places[before], places[before + 1])
    return np.asarray(np.where((share == 0.0) | (share == 1.0), exact, way), np.float32)
