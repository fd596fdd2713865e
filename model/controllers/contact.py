"""Where a hand touches the object in an image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float64, Int32
from scipy import ndimage

from model.types import Array, Masks

TOUCH = 0.008
"""Object and hand touch when they are this share of the image diagonal apart, or nearer."""
TOGETHER = 0.2
"""Contacts of one hand nearer than this share of the object's size are one grip."""
LASTING = 6
"""Frames a contact must last to be a grip."""
HANDS = 2
"""More grips than a person has hands are not believed."""
_SMALL = 0.15
"""A contact of less than this share of the largest one is a chance neighbourhood of pixels."""


def touch_distance(mask: Bool[Array, "H W"]) -> int:
    """How near is touching [px]."""
    return max(2, round(TOUCH * float(np.hypot(*mask.shape))))


def contact_band(
    object_mask: Bool[Array, "H W"], hand_mask: Bool[Array, "H W"], reach: int
) -> Bool[Array, "H W"]:
    """Pixels of the object within `reach` [px] of the hand."""
    return np.asarray(grown(hand_mask, reach) & object_mask)


def contact_groups(
    object_mask: Bool[Array, "H W"], hand_mask: Bool[Array, "H W"]
) -> list[Bool[Array, "H W"]]:
    """The patches of the object that hands touch, one per hand, the largest first, at most `HANDS`.

    A hand is a connected piece of the hand mask. Where it touches in several places that are near each
    other they are one grip; of places far apart (a fist and the forearm behind it) the largest counts.
    """
    reach = touch_distance(object_mask)
    labels, count = ndimage.label(contact_band(object_mask, hand_mask, reach), structure=np.ones((3, 3)))
    if count == 0:
        return []
    hands = hand_pieces(hand_mask)
    apart = TOGETHER * float(np.sqrt(object_mask.sum()))
    patches = sorted((labels == index + 1 for index in range(count)), key=lambda patch: -int(patch.sum()))
    grips: dict[int, Bool[Array, "H W"]] = {}
    for patch in patches:
        owner = int(np.bincount(hands[patch]).argmax())
        if owner not in grips:
            grips[owner] = patch
        elif np.linalg.norm(centre_of(grips[owner]) - centre_of(patch)) < apart:
            grips[owner] = grips[owner] | patch
    largest = sorted(grips.values(), key=lambda grip: -int(grip.sum()))[:HANDS]
    return [grip for grip in largest if grip.sum() >= _SMALL * largest[0].sum()]


def hand_pieces(hand_mask: Bool[Array, "H W"]) -> Int32[Array, "H W"]:
    """Labels of the hands, 1 …, each grown by the touch distance; 0 elsewhere."""
    labels, _ = ndimage.label(grown(hand_mask, touch_distance(hand_mask)), structure=np.ones((3, 3)))
    return np.asarray(labels, np.int32)


def later_grip(
    masks: Masks, start: int, taken: list[Float64[Array, "T 2"]]
) -> tuple[int, Bool[Array, "H W"]] | None:
    """The first frame from `start` on in which a hand that holds no grip yet touches, and where.

    It must be a piece of the hand mask that no known grip belongs to, away from all of them, and still
    touch near there `LASTING` frames later.

    Args:
        masks: Object and hand.
        start: The frame to begin with.
        taken: Known grips from the keyframe on [px].
    """
    for frame in range(start, len(masks.object) - LASTING):
        if not masks.hand[frame].any():
            continue
        places = [path[frame - masks.keyframe] for path in taken]
        for patch in _free_patches(masks, frame, places):
            after = contact_groups(masks.object[frame + LASTING], masks.hand[frame + LASTING])
            near = TOGETHER * float(np.sqrt(masks.object[frame].sum()))
            if any(np.linalg.norm(centre_of(other) - centre_of(patch)) < near for other in after):
                return frame, patch
    return None


def _free_patches(masks: Masks, frame: int, places: list[Float64[Array, " 2"]]) -> list[Bool[Array, "H W"]]:
    """Contacts of hands that hold none of the grips at `places`."""
    thing, hand = masks.object[frame], masks.hand[frame]
    pieces = hand_pieces(hand)
    apart = TOGETHER * float(np.sqrt(thing.sum()))
    height, width = thing.shape
    owners: set[int] = set()
    for place in places:
        column, row = np.round(np.clip(place, 0, (width - 1, height - 1))).astype(int)
        window = pieces[max(row - 12, 0) : row + 13, max(column - 12, 0) : column + 13]
        owners.update(int(label) for label in np.unique(window[window > 0]))
    return [
        patch
        for patch in contact_groups(thing, hand)
        if int(np.bincount(pieces[patch]).argmax()) not in owners
        and all(np.linalg.norm(centre_of(patch) - place) > apart for place in places)
    ]


def centre_of(mask: Bool[Array, "H W"]) -> Float64[Array, " 2"]:
    """Mean pixel (x, y) of a mask."""
    return np.asarray(np.argwhere(mask).mean(axis=0)[::-1], np.float64)


def grown(mask: Bool[Array, "H W"], reach: int) -> Bool[Array, "H W"]:
    """The mask and what lies within `reach` [px] of it."""
    if mask.size == 0:
        return mask
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)
