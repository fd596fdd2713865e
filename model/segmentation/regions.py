"""Small operations on binary regions."""

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32

from model.types import Array

Box = tuple[slice, slice]


def labels_of(mask: Bool[Array, "H W"]) -> tuple[int, Int32[Array, "H W"], Int32[Array, " n"]]:
    """Connected components: their number with the background, the labels, and their areas [px]."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return count, labels, stats[:, cv2.CC_STAT_AREA]


def without_specks(mask: Bool[Array, "H W"], area: float) -> Bool[Array, "H W"]:
    """Only the components of at least `area` [px]."""
    _, labels, areas = labels_of(mask)
    keep = areas >= area
    keep[0] = False
    kept: Bool[Array, "H W"] = keep[labels]
    return kept


def without_holes(mask: Bool[Array, "H W"], area: float) -> Bool[Array, "H W"]:
    """The mask with holes smaller than `area` [px] filled."""
    filled: Bool[Array, "H W"] = ~without_specks(~mask, area)
    return filled


def touching(mask: Bool[Array, "H W"], other: Bool[Array, "H W"]) -> Bool[Array, "H W"]:
    """Only the components of `mask` that share a pixel with `other`."""
    count, labels, _ = labels_of(mask)
    keep = np.zeros(count, bool)
    keep[labels[other]] = True
    keep[0] = False
    kept: Bool[Array, "H W"] = keep[labels]
    return kept


def grown(mask: Bool[Array, "H W"], radius: int) -> Bool[Array, "H W"]:
    """Dilated by a disc [px]."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return cv2.dilate(mask.astype(np.uint8), disc).astype(bool)


def signed_distance(mask: Bool[Array, "H W"]) -> Float32[Array, "H W"]:
    """Distance to the mask's edge [px], positive inside."""
    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray((inside - outside), np.float32)


def around(mask: Bool[Array, "H W"], margin: int) -> Box:
    """The box of the mask, widened by `margin` [px] within the picture; the mask must not be empty."""
    ys, xs = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return (
        slice(max(0, int(ys[0]) - margin), int(ys[-1]) + margin + 1),
        slice(max(0, int(xs[0]) - margin), int(xs[-1]) + margin + 1),
    )


def without_gaps(mask: Bool[Array, "H W"], radius: int) -> Bool[Array, "H W"]:
    """Closed by a disc [px] and all its holes filled."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, disc).astype(bool)
    frame = np.ones_like(closed)
    frame[1:-1, 1:-1] = False
    filled: Bool[Array, "H W"] = ~touching(~closed, frame & ~closed)
    return filled


def with_doubtful_holes(
    mask: Bool[Array, "H W"], evidence: Float32[Array, "H W"], least: float
) -> Bool[Array, "H W"]:
    """The mask with those holes filled whose mean `evidence` is above `least`, and all tiny ones."""
    filled = mask.copy()
    count, labels, areas = labels_of(without_gaps(mask, 2) & ~mask)
    for label in range(1, count):
        hole = labels == label
        if areas[label] < 12 or (evidence[hole].mean() > least and areas[label] < 0.2 * mask.sum()):
            filled |= hole
    return filled
