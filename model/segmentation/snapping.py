"""Masks brought to the full size, their outline drawn to the picture's own edges."""

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from model.segmentation.color_model import ColorModel, color_codes, log_ratio, to_lab
from model.segmentation.min_cut import edge_weights, min_cut
from model.segmentation.regions import around, signed_distance
from model.types import Array

BAND = 5.0
"""How far an outline may move [px]."""
REACH = 10
"""How far from the outline the colours around the object are learned [px]."""
FAT = 1.5
"""What soft shadows and blur add to a mask found at a smaller size [px]."""


def enlarge(mask: Bool[Array, "h w"], height: int, width: int) -> Bool[Array, "H W"]:
    """The mask at the full size, its outline smooth."""
    full = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full > 0.5)


def snap(
    mask: Bool[Array, "H W"], others: Bool[Array, "H W"], image: UInt8[Array, "H W 3"]
) -> Bool[Array, "H W"]:
    """The mask, its outline moved by at most `BAND` to where colours change; `others` are never entered."""
    if not mask.any():
        return mask
    window = around(mask, REACH + 2)
    near, other = mask[window], others[window]
    lab = to_lab(image[window])
    codes, distance = color_codes(lab), signed_distance(near)
    core = distance > BAND
    ring = (distance < -1) & (distance > -REACH) & ~other
    if core.sum() < 50 or ring.sum() < 50:
        return mask
    color = np.clip(log_ratio(ColorModel.of(codes, core), ColorModel.of(codes, ring))[codes], -1, 1)
    place = np.clip((distance - FAT) / 2.5, -1, 1)
    evidence = (color + place - 8.0 * other).astype(np.float32)
    u = min_cut(evidence, *edge_weights(lab, 3.0), near.astype(np.float32), 20)
    snapped = mask.copy()
    snapped[window] = np.where(np.abs(distance) <= BAND, (u > 0.5) & ~other, near)
    return snapped


def snap_all(
    objects: Bool[Array, "T h w"], hands: Bool[Array, "T h w"], images: UInt8[Array, "T H W 3"]
) -> tuple[Bool[Array, "T H W"], Bool[Array, "T H W"]]:
    """Objects and hands at the full size; they never overlap."""
    height, width = images.shape[1:3]

    def one(index: int) -> tuple[Bool[Array, "H W"], Bool[Array, "H W"]]:
        hand = enlarge(hands[index], height, width)
        mask = enlarge(objects[index], height, width) & ~hand
        return snap(mask, hand, images[index]), hand

    full = np.empty((2, *images.shape[:3]), bool)
    with ThreadPoolExecutor(2) as pool:
        for index, pair in enumerate(pool.map(one, range(len(images)))):
            full[0, index], full[1, index] = pair
    return full[0], full[1]
