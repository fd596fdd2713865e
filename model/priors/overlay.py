"""The picture of a part that a material expert is shown."""

import cv2
import numpy as np
from jaxtyping import UInt8

from model.types import Array, PartView

TINT = (255, 120, 0)
TINT_SHARE = 0.15
DIMMED = 0.35
"""Brightness that is left to everything else."""
MARGIN = 0.15
"""Surroundings shown around the object, in its longer side."""


def overlay(part: PartView) -> UInt8[Array, "h w 3"]:
    """The surroundings of the object with the part outlined and tinted and the rest dimmed.

    A part of which no pixel is visible leaves nothing but the dimmed surroundings.
    """
    image = part.image.astype(np.float32)
    shown = np.where(
        part.mask[..., None], (1 - TINT_SHARE) * image + TINT_SHARE * np.array(TINT), DIMMED * image
    )
    canvas = np.ascontiguousarray(np.round(shown), dtype=np.uint8)
    outlines, _ = cv2.findContours(part.mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(canvas, outlines, -1, TINT, thickness=2)
    top, bottom, left, right = _surroundings(part)
    return np.ascontiguousarray(canvas[top:bottom, left:right])


def overlay_png(part: PartView) -> bytes:
    """The same as a PNG file."""
    _, data = cv2.imencode(".png", overlay(part)[..., ::-1])
    return data.tobytes()


def _surroundings(part: PartView) -> tuple[int, int, int, int]:
    """Top, bottom, left, right of the object's box with a margin [px]."""
    shown = part.object_mask | part.mask
    if not shown.any():
        return 0, shown.shape[0], 0, shown.shape[1]
    rows, columns = np.nonzero(shown)
    margin = int(np.ceil(MARGIN * max(np.ptp(rows), np.ptp(columns)))) + 2
    height, width = shown.shape
    return (
        max(0, int(rows.min()) - margin),
        min(height, int(rows.max()) + 1 + margin),
        max(0, int(columns.min()) - margin),
        min(width, int(columns.max()) + 1 + margin),
    )
