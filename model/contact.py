"""Where a hand touches the object in an image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float64
from scipy import ndimage

from model.types import Array, Masks

TOUCH = 0.008
"""Object and hand touch when they are this share of the image diagonal apart, or nearer."""
TOGETHER = 0.35
"""Contacts of one hand nearer than this share of the object's size are one grip."""
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
    return grown(hand_mask, reach) & object_mask


def contact_groups(
    object_mask: Bool[Array, "H W"], hand_mask: Bool[Array, "H W"]
) -> list[Bool[Array, "H W"]]:
    """The patches of the object that hands touch, one per grip, the largest first, at most `HANDS`."""
    reach = touch_distance(object_mask)
    band = contact_band(object_mask, hand_mask, reach)
    labels, count = ndimage.label(band, structure=np.ones((3, 3)))
    if count == 0:
        return []
    hands, _ = ndimage.label(grown(hand_mask, reach), structure=np.ones((3, 3)))
    patches = [labels == index + 1 for index in range(count)]
    owners = [int(np.bincount(hands[patch]).argmax()) for patch in patches]
    apart = TOGETHER * float(np.sqrt(object_mask.sum()))
    merged = _merge(patches, owners, apart)
    sizes = np.array([patch.sum() for patch in merged])
    order = np.argsort(-sizes, kind="stable")[:HANDS]
    return [merged[index] for index in order if sizes[index] >= _SMALL * sizes.max()]


def first_contact(masks: Masks) -> int | None:
    """The first frame from the keyframe on in which a hand touches the object."""
    for index in range(masks.keyframe, len(masks.object)):
        if masks.hand[index].any() and contact_groups(masks.object[index], masks.hand[index]):
            return index
    return None


def centre_of(mask: Bool[Array, "H W"]) -> Float64[Array, " 2"]:
    """Mean pixel (x, y) of a mask."""
    return np.argwhere(mask).mean(axis=0)[::-1].astype(np.float64)


def grown(mask: Bool[Array, "H W"], reach: int) -> Bool[Array, "H W"]:
    """The mask and what lies within `reach` [px] of it."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)


def _merge(patches: list[Bool[Array, "H W"]], owners: list[int], apart: float) -> list[Bool[Array, "H W"]]:
    """Unite patches of one hand whose centres are near each other."""
    centres = [centre_of(patch) for patch in patches]
    merged: list[tuple[int, Bool[Array, "H W"], Float64[Array, " 2"]]] = []
    for patch, owner, centre in sorted(
        zip(patches, owners, centres, strict=True), key=lambda item: -int(item[0].sum())
    ):
        for index, (other, mask, place) in enumerate(merged):
            if other == owner and np.linalg.norm(place - centre) < apart:
                merged[index] = (other, mask | patch, place)
                break
        else:
            merged.append((owner, patch, centre))
    return [patch for _, patch, _ in merged]
