"""Finding the object and the hands in one frame."""

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from model.segmentation.background import UNCHANGED, Contrast
from model.segmentation.color_model import as_bytes
from model.segmentation.min_cut import edge_weights, min_cut
from model.segmentation.regions import (
    around,
    grown,
    labels_of,
    signed_distance,
    touching,
    with_doubtful_holes,
    without_gaps,
    without_holes,
    without_specks,
)
from model.segmentation.saliency import border_colors, border_distance, reach
from model.types import Array

MIN_AREA = 0.002
"""The smallest object we believe in, as a share of the picture."""


def hand_regions(skin: Float32[Array, "H W"]) -> Bool[Array, "H W"]:
    """Compact regions of skin, from its log-odds per pixel."""
    smooth = cv2.GaussianBlur(np.clip(skin, -4, 4), (0, 0), 1.2)
    return without_specks(smooth > 0.5, 0.001 * skin.size)


def salience(
    lab: Float32[Array, "H W 3"], hand: Bool[Array, "H W"], cluttered: bool
) -> Float32[Array, "H W"]:
    """How much each pixel looks like part of the handled object, in Lab units.

    Args:
        lab: The picture.
        hand: Where hands are.
        cluttered: Whether the surroundings may be gaudy (a camera in motion); else they are taken as
            plain, and thin objects are seen better.
    """
    soft = cv2.GaussianBlur(lab, (0, 0), 1.0)
    height, width = hand.shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    center = np.exp(-0.5 * (np.square((x / width - 0.5) / 0.4) + np.square((y / height - 0.5) / 0.4)))
    out = np.minimum(border_distance(soft), 50) * (1 - 0.75 * border_colors(soft))
    if cluttered:
        # A gaudy shirt stands out from itself; seen from further away it is one colour, up to the border.
        coarse, blurred = (cv2.GaussianBlur(lab, (0, 0), share * width) for share in (0.02, 0.05))
        out = np.sqrt(out * np.minimum(border_distance(coarse), 50)) * (1 - border_colors(blurred, 6))
    return np.asarray(cv2.GaussianBlur(out * reach(hand, 0.25) * center * ~hand, (0, 0), 2.0), np.float32)


def find_object(
    lab: Float32[Array, "H W 3"], hand: Bool[Array, "H W"], cluttered: bool
) -> Bool[Array, "H W"]:
    """The object that stands out near the hands; empty where nothing does."""
    salient = salience(lab, hand, cluttered)
    peak = float(np.percentile(salient, 99))
    if peak < 3.0:
        return np.zeros_like(hand)
    trimap = np.full(hand.shape, cv2.GC_BGD, np.uint8)
    trimap[salient > (0.3 if cluttered else 0.08) * peak] = cv2.GC_PR_BGD
    trimap[salient > 0.45 * peak] = cv2.GC_PR_FGD
    trimap[hand] = cv2.GC_BGD
    found = grab_cut(lab, trimap)
    return coherent(found, salient, hand)


def object_in_box(
    lab: Float32[Array, "H W 3"], hand: Bool[Array, "H W"], box: tuple[slice, slice]
) -> Bool[Array, "H W"]:
    """The object inside a box the user drew."""
    trimap = np.full(hand.shape, cv2.GC_BGD, np.uint8)
    trimap[box] = cv2.GC_PR_FGD
    trimap[hand] = cv2.GC_BGD
    found = grab_cut(lab, trimap)
    return coherent(found, found.astype(np.float32), hand)


def grab_cut(lab: Float32[Array, "H W 3"], trimap: Array, rounds: int = 4) -> Bool[Array, "H W"]:
    """GrabCut in Lab from a map of its four labels.

    Reference:
        Rother, Kolmogorov, Blake (2004), GrabCut: interactive foreground extraction using iterated
        graph cuts.
    """
    sure = (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)
    if sure.sum() < 20 or (~sure).sum() < 20:
        return np.asarray(sure)
    cv2.setRNGSeed(0)
    back, front = np.zeros((1, 65)), np.zeros((1, 65))
    whole = (0, 0, lab.shape[1], lab.shape[0])
    mode = cv2.GC_INIT_WITH_MASK
    labels, _, _ = cv2.grabCut(as_bytes(lab), trimap.copy(), whole, back, front, rounds, mode)
    return np.isin(np.asarray(labels), (cv2.GC_FGD, cv2.GC_PR_FGD))


def coherent(
    found: Bool[Array, "H W"], weight: Float32[Array, "H W"], hand: Bool[Array, "H W"]
) -> Bool[Array, "H W"]:
    """One object: the weightiest component, and others of weight that all but touch it."""
    found = without_specks(found, 0.0002 * found.size)
    count, labels, _ = labels_of(found)
    if count == 1:
        return np.asarray(found)
    weights = np.bincount(labels.ravel(), weights=weight.ravel(), minlength=count)
    weights[0] = 0
    main = labels == int(weights.argmax())
    near = grown(main, 4 + round(0.01 * found.shape[1]))
    for label in np.flatnonzero(weights > 0.02 * weights.max()):
        part = labels == label
        if (part & near).any():
            main |= part
    if main.sum() < MIN_AREA * found.size:
        return np.zeros_like(found)
    return np.asarray(without_holes(main, 0.002 * found.size) & ~hand)


def settle(
    object_mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]
) -> tuple[Bool[Array, "H W"], Bool[Array, "H W"]]:
    """Give skin-coloured spots that the object encloses (a plush's eyes) to the object; return both."""
    count, labels, areas = labels_of(hand)
    for label in range(1, count):
        part = labels == label
        window = around(part, 3)
        ring = grown(part[window], 2) & ~part[window]
        enclosed = (object_mask[window] & ring).sum() > 0.6 * ring.sum()
        if enclosed and areas[label] < 0.3 * object_mask.sum():
            object_mask, hand = object_mask | part, hand & ~part
    return object_mask, np.asarray(hand & ~object_mask)


def refined(
    lab: Float32[Array, "H W 3"],
    texture: UInt8[Array, "H W"],
    seed: Bool[Array, "H W"],
    hand: Bool[Array, "H W"],
    contrast: Contrast,
) -> Bool[Array, "H W"]:
    """The object on the keyframe, once it is known how it differs from the empty scene."""
    distance = signed_distance(seed)
    codes = contrast.codes(lab, texture)
    odds = np.clip(contrast.odds(codes), -3, 3)
    evidence = odds + np.clip(distance / 4, -1.5, 0.5) - 0.2 - 3.0 * hand
    weights = edge_weights(lab, 3.0)
    u = min_cut(evidence.astype(np.float32), *weights, seed.astype(np.float32), 80)
    # White fur on a white table does not tell; where the rest of the object encloses it, believe the seed.
    doubtful = without_gaps(u > 0.5, 6) & seed & (contrast.doubt(codes) > 0.2) & ~hand
    u = min_cut(np.where(doubtful, np.maximum(evidence, 1.5), evidence).astype(np.float32), *weights, u, 80)
    found = without_holes(touching((u > 0.5) & ~hand, distance > 3), 30.0)
    found = with_doubtful_holes(found, np.where(hand, np.float32(-9), contrast.changed(codes)), UNCHANGED)
    return np.asarray(found if found.any() else seed)
