"""Does the object rest on something? Looked for in the image around it."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, UInt8
from scipy import ndimage

from model.reconstruction.outline import overlap
from model.types import Array, Frames, Masks

SAMPLED_FRAMES = 9
STILL_STEP = 14
"""A pixel has changed if its brightness differs by more than this [0..255]."""


@dataclass(frozen=True)
class Support:
    """What holds the object from below on the keyframe."""

    present: bool
    static: bool
    """Whether the camera stands still."""
    reason: str
    """One phrase for the manifest."""


def find_support(frames: Frames, masks: Masks) -> Support:
    """Tell an object lying on a table from one held in the air.

    A table stays where it is and goes on evenly around the object. So: the surroundings of the object do
    not change over the clip (static camera), and most of the ring around it has one slowly varying
    colour, or the object itself keeps still although parts of it are free.
    """
    key = masks.keyframe
    ring = _ring(masks.object[key], masks.hand[key])
    still = _still_share(frames, masks)
    if np.count_nonzero(ring) < 50:
        return Support(False, still >= 0.6, "the object fills the image, nothing around it can be judged")
    if still < 0.6:
        return Support(
            False, False, f"the surroundings move ({1 - still:.0%} of them change): held in the air"
        )
    even = _even_share(frames.images[key], ring)
    if even >= 0.55:
        return Support(True, True, f"{even:.0%} of the surroundings are one even, static surface")
    rest = _rest_share(frames, masks)
    if rest >= 0.9:
        return Support(True, True, f"the object keeps still on static surroundings ({rest:.0%} overlap)")
    return Support(False, True, f"no even surface around the object ({even:.0%}): held in the air")


def _ring(object_mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]) -> Bool[Array, "H W"]:
    """The neighbourhood of the object, a quarter of its size wide, without its soft outline and the hand."""
    reach = max(6.0, 0.25 * float(np.sqrt(np.count_nonzero(object_mask))))
    distance = ndimage.distance_transform_edt(~object_mask)
    near_hand = ndimage.binary_dilation(hand, iterations=6)
    ring: Bool[Array, "H W"] = (distance > 4) & (distance < reach) & ~near_hand
    return ring


def _still_share(frames: Frames, masks: Masks) -> float:
    """Share of the image, away from object and hand, that looks the same over the clip."""
    key = cv2.cvtColor(frames.images[masks.keyframe], cv2.COLOR_RGB2GRAY)
    key = cv2.GaussianBlur(key, (0, 0), 1.5).astype(np.int16)
    held = masks.object[masks.keyframe] | masks.hand[masks.keyframe]
    shares = []
    for index in sampled(len(frames.images)):
        gray = cv2.GaussianBlur(cv2.cvtColor(frames.images[index], cv2.COLOR_RGB2GRAY), (0, 0), 1.5)
        moving = (held | masks.object[index] | masks.hand[index]).astype(np.uint8)
        free = cv2.dilate(moving, np.ones((25, 25), np.uint8)) == 0
        if index != masks.keyframe and np.count_nonzero(free) > 50:
            shares.append(float((np.abs(gray.astype(np.int16) - key)[free] < STILL_STEP).mean()))
    return float(np.median(shares)) if shares else 1.0


def _even_share(image: UInt8[Array, "H W 3"], ring: Bool[Array, "H W"]) -> float:
    """Share of the ring close to one colour that varies linearly over the image (uneven light allowed)."""
    lab = cv2.cvtColor(cv2.GaussianBlur(image, (0, 0), 1.5), cv2.COLOR_RGB2LAB).astype(np.float64)
    rows, columns = np.nonzero(ring)
    colors = lab[rows, columns] * [0.6, 1.5, 1.5]  # shadows change lightness more than hue
    terms = np.stack([np.ones_like(rows), columns / ring.shape[1], rows / ring.shape[0]], -1).astype(
        np.float64
    )
    close = np.linalg.norm(colors - np.median(colors, axis=0), axis=1) < 40.0
    for _ in range(6):
        if np.count_nonzero(close) < 20:
            return 0.0
        fit = np.linalg.lstsq(terms[close], colors[close], rcond=None)[0]
        close = np.linalg.norm(colors - terms @ fit, axis=1) < 12.0
    return float(close.mean())


def _rest_share(frames: Frames, masks: Masks) -> float:
    """Overlap of the object with itself a quarter of a second around the keyframe."""
    step = max(1, round(0.25 * frames.fps))
    key = masks.object[masks.keyframe]
    other = masks.object[min(masks.keyframe + step, len(masks.object) - 1)]
    return overlap(key, other)


def background_of(frames: Frames) -> UInt8[Array, "H W 3"]:
    """Median image of the clip: what stays."""
    chosen = frames.images[sampled(len(frames.images))]
    middle: UInt8[Array, "H W 3"] = np.median(chosen, axis=0).astype(np.uint8)
    return middle


def sampled(count: int) -> list[int]:
    """Few frame numbers spread over a clip."""
    return sorted({int(i) for i in np.linspace(0, count - 1, SAMPLED_FRAMES)})
