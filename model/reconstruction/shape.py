"""Sheet, rope or solid, from the outline and the shading of the object."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64, Int, UInt8
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from model.reconstruction.outline import overlap
from model.types import Array, ShapeClass

ROPE_SLENDERNESS = 5.0
"""Length over width from which a uniform strand is a rope."""
SHEET_SHADING = 0.10
"""Relative spread of brightness across an object up to which it may be flat."""


def classify_shape(image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]) -> ShapeClass:
    """Tell what kind of thing an outline belongs to.

    - rope: one strand, many times longer than wide, of even width;
    - sheet: a polygon with few straight sides, evenly coloured and evenly lit (a flat thing has one
      normal, so one shade; a cushion's shade turns with its surface);
    - solid: everything else.
    """
    if _is_rope(mask):
        return "rope"
    return "sheet" if _is_sheet(image, mask) else "solid"


def _is_rope(mask: Bool[Array, "H W"]) -> bool:
    """Whether the longest way through the mask explains nearly all of it with one width."""
    small = _reduced(mask)
    distance = cv2.distanceTransform(np.pad(small, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    path = _longest_path(small, distance)
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    radii = distance[path[:, 0], path[:, 1]]
    width = 2.0 * float(np.median(radii))
    explained = length * width / int(np.count_nonzero(small))
    body = radii[len(radii) // 10 : -len(radii) // 10] if len(radii) > 20 else radii
    uneven = float(np.std(body) / max(float(np.mean(body)), 1e-9))
    return length / width > ROPE_SLENDERNESS and explained > 0.75 and uneven < 0.35


def _reduced(mask: Bool[Array, "H W"]) -> Bool[Array, "h w"]:
    """The mask cropped and shrunk so that paths through it are cheap."""
    rows, columns = np.nonzero(mask)
    crop = mask[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].astype(np.uint8)
    scale = min(1.0, float(np.sqrt(6000.0 / int(np.count_nonzero(crop)))))
    if scale < 1.0:
        size = (max(1, round(crop.shape[1] * scale)), max(1, round(crop.shape[0] * scale)))
        crop = (cv2.resize(crop.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5).astype(
            np.uint8
        )
    label, count = ndimage.label(crop, structure=np.ones((3, 3)))
    if count > 1:
        crop = (label == 1 + np.argmax(np.bincount(label.ravel())[1:])).astype(np.uint8)
    return crop > 0


def _longest_path(mask: Bool[Array, "h w"], distance: Float[Array, "h w"]) -> Int[Array, "L 2"]:
    """Pixels of a path between the two ends farthest apart inside the mask, kept to its middle."""
    index = np.full(mask.shape, -1)
    index[mask] = np.arange(np.count_nonzero(mask))
    pixels = np.argwhere(mask)
    sources, targets, costs = [], [], []
    for row, column in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = np.roll(index, (-row, -column), (0, 1))
        valid = (index >= 0) & (other >= 0)
        valid[mask.shape[0] - row :] = False
        valid[:, mask.shape[1] - 1 if column == 1 else mask.shape[1] :] = False
        if column == -1:
            valid[:, 0] = False
        sources.append(index[valid])
        targets.append(other[valid])
        costs.append(np.full(np.count_nonzero(valid), np.hypot(row, column)))
    i, j, cost = np.concatenate(sources), np.concatenate(targets), np.concatenate(costs)
    inner = distance[mask]
    # Paths near the outline are dear: the way follows the middle line.
    dear = cost * (1.0 + 3.0 * (1.0 - np.minimum(inner[i], inner[j]) / max(float(inner.max()), 1e-9)))
    count = len(pixels)
    plain = coo_matrix((cost, (i, j)), (count, count)).tocsr()
    first = int(np.argmax(_finite(dijkstra(plain, directed=False, indices=int(inner.argmax())))))
    last = int(np.argmax(_finite(dijkstra(plain, directed=False, indices=first))))
    central = coo_matrix((dear, (i, j)), (count, count)).tocsr()
    _, before = dijkstra(central, directed=False, indices=first, return_predecessors=True)
    way = [last]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    path: Int[Array, "L 2"] = pixels[way]
    return path


def _finite(values: Float64[Array, " N"]) -> Float64[Array, " N"]:
    return np.where(np.isfinite(values), values, -1.0)


def _is_sheet(image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]) -> bool:
    """Whether the outline is a polygon of few straight sides around one even shade."""
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea)
    area = float(cv2.contourArea(outline))
    hull = cv2.convexHull(outline)
    if area < 50 or area / max(float(cv2.contourArea(hull)), 1.0) < 0.88:
        return False
    polygon = _polygon(hull)
    filled = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(filled, [polygon.astype(np.int32)], 1)
    straight = overlap(mask, filled > 0)
    return len(polygon) <= 8 and straight > 0.93 and _shading(image, mask) < SHEET_SHADING


def _polygon(hull: Int[Array, "P 1 2"]) -> Int[Array, "Q 1 2"]:
    """The convex hull with as few corners as 1 % of its length allows."""
    polygon: Int[Array, "Q 1 2"] = cv2.approxPolyDP(hull, 0.01 * cv2.arcLength(hull, True), True)
    return polygon


def _shading(image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]) -> float:
    """Relative spread of slow brightness changes inside the mask."""
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    inner = ndimage.binary_erosion(mask, iterations=3)
    if np.count_nonzero(inner) < 30:
        return 1.0
    sigma = 0.04 * float(np.sqrt(np.count_nonzero(mask)))
    known = inner.astype(np.float32)
    smooth = cv2.GaussianBlur(gray * known, (0, 0), sigma) / np.maximum(
        cv2.GaussianBlur(known, (0, 0), sigma), 1e-6
    )
    return float(smooth[inner].std() / max(float(smooth[inner].mean()), 1.0))
