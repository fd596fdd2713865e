"""Sheet, rope or solid, told from a silhouette and its shading."""

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from model.types import Array, ShapeClass

ROPE_UNIFORMITY = 0.4
"""Mean over largest distance to the outline: 1/2 in a ribbon, 1/3 in a disc, less in a body with limbs."""
ROPE_SLENDERNESS = 14.0
"""Area over squared inscribed radius: 4 length / width in a ribbon, 3 to 5 in compact shapes."""
SHEET_QUADRILATERAL = 0.85
"""Overlap with a quadrilateral from which an outline counts as one."""
SHEET_SHADING = 20.0
"""Range of smoothed lightness [L*] above which a quadrilateral is taken for a cushion."""
FLAT_SOLIDITY, FLAT_SHADING = 0.8, 6.0
"""A compact outline with next to no shading is flat, whatever its corners."""


def guess_shape(image: UInt8[Array, "H W 3"], object_mask: Bool[Array, "H W"]) -> ShapeClass:
    """The shape class that the largest piece of the silhouette suggests.

    A rope is long and evenly thin; a sheet fills a quadrilateral (or any compact outline) and is evenly lit;
    everything else is solid. An empty mask is solid.
    """
    if not object_mask.any():
        return "solid"
    piece = _largest_piece(object_mask)
    distance = cv2.distanceTransform(np.pad(piece, 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    inside = piece > 0
    radius = float(distance.max())
    slenderness = float(inside.sum()) / radius**2
    if slenderness >= ROPE_SLENDERNESS and float(distance[inside].mean()) / radius >= ROPE_UNIFORMITY:
        return "rope"
    outlines, _ = cv2.findContours(piece, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea)
    shading = _shading(image, piece, radius)
    if shading < SHEET_SHADING and _quadrilateral_overlap(outline, piece) >= SHEET_QUADRILATERAL:
        return "sheet"
    hull = max(float(cv2.contourArea(cv2.convexHull(outline))), 1.0)
    flat = shading < FLAT_SHADING and float(cv2.contourArea(outline)) / hull >= FLAT_SOLIDITY
    return "sheet" if flat else "solid"


def _largest_piece(mask: Bool[Array, "H W"]) -> UInt8[Array, "H W"]:
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    largest = 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
    piece: UInt8[Array, "H W"] = (labels == largest).astype(np.uint8)
    return piece


def _shading(image: UInt8[Array, "H W 3"], piece: UInt8[Array, "H W"], radius: float) -> float:
    """Range of lightness [L*] over the piece, patterns finer than its thickness smoothed away."""
    lab: Float32[Array, "H W 3"] = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
    sigma = max(radius / 4.0, 1.0)
    weight = cv2.GaussianBlur(piece.astype(np.float32), (0, 0), sigma)
    smooth = cv2.GaussianBlur(lab[..., 0] * piece, (0, 0), sigma) / np.maximum(weight, 1e-3)
    low, high = np.percentile(smooth[piece > 0], [5, 95])
    return float(high - low)


def _quadrilateral_overlap(outline: Array, piece: UInt8[Array, "H W"]) -> float:
    """IoU of the piece with the first simplification of its outline that has four corners or fewer."""
    length = cv2.arcLength(outline, True)
    for share in np.linspace(0.01, 0.1, 19):
        corners = cv2.approxPolyDP(outline, share * length, True)
        if len(corners) <= 4:
            drawn = cv2.fillPoly(np.zeros_like(piece), [corners], (1,))
            return float((drawn & piece).sum() / max(int((drawn | piece).sum()), 1))
    return 0.0
