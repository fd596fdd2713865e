"""Discs inscribed in an outline: its medial axis, as few as cover it."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int
from scipy.spatial.distance import cdist

from model.types import Array


@dataclass(frozen=True)
class Discs:
    """A cover of a mask by inscribed discs, largest first; lengths as if nothing were foreshortened."""

    centers: Float64[Array, "K 2"]
    """In the image [px]."""
    radii: Float64[Array, " K"]
    """[px]."""
    thickness: Float64[Array, " K"]
    """Radius of the thickest body around each centre [px]."""
    owners: Int[Array, " K"]
    """The largest disc over each centre; mostly itself."""
    nested: Float64[Array, " K"]
    """How much each lies within its owner, 0..1: ragged outlines leave small discs in a large one's rim."""


def inscribed(mask: Bool[Array, "H W"], direction: Float64[Array, " 2"], squeeze: float) -> Discs:
    """Few discs that cover a mask, measured after undoing a foreshortening.

    Args:
        mask: The silhouette.
        direction: Unit image direction along which things look shorter than they are.
        squeeze: By how much, 0..1.
    """
    rows, columns = np.nonzero(mask)
    corner = np.array([columns.min(), rows.min()], np.float64)
    stretch = np.eye(2) + (1.0 / squeeze - 1.0) * np.outer(direction, direction)
    size = np.array([np.ptp(columns), np.ptp(rows)]) + 1.0
    ends = np.array([[0, 0], [size[0], 0], [0, size[1]], size]) @ stretch.T
    shift = 4.0 - ends.min(0)
    width, height = (int(v) for v in np.ceil(np.ptp(ends, axis=0)) + 9)
    affine = np.hstack([stretch, (shift - stretch @ corner)[:, None]])
    upright = cv2.warpAffine(mask.astype(np.float32), affine, (width, height)) > 0.5
    cover = _cover(upright)
    centers, radii = cover[:, :2], cover[:, 2]
    # Largest first, so the first disc that covers a centre is the largest that does.
    apart = cdist(centers, centers)
    owners = np.argmax((apart < radii[None]) | np.eye(len(radii), dtype=bool), axis=1)
    beyond = (apart[np.arange(len(radii)), owners] + radii) / radii[owners]
    nested = np.where(owners == np.arange(len(radii)), 0.0, np.clip((1.5 - beyond) / 0.35, 0.0, 1.0))
    smooth = _thickness_map(upright, cover)
    at_centres = smooth[centers[:, 1].astype(int), centers[:, 0].astype(int)].astype(np.float64)
    pixels = (centers - affine[:, 2]) @ np.linalg.inv(stretch).T
    return Discs(pixels, radii, np.maximum(at_centres, radii), owners, nested)


def _cover(mask: Bool[Array, "H W"]) -> Float64[Array, "K 3"]:
    """Greedy cover of a mask by inscribed discs (x, y, radius) [px], largest first."""
    rough = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # OpenCV's last digit changes from call to call; the squares are whole numbers, which says what it is.
    distance = np.sqrt(np.rint(np.square(rough, dtype=np.float64)))
    # A disc that lies inside a neighbour's adds nothing: keep the ridge, where the distance turns.
    slope = np.hypot(*np.gradient(distance))
    ridge = mask & (slope < 0.93)
    rows, columns = np.nonzero(ridge if ridge.any() else mask)
    order = np.argsort(-distance[rows, columns], kind="stable")
    covered = np.zeros(mask.shape, np.uint8)
    kept = []
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        radius = max(float(distance[row, column]) - 0.5, 0.5)
        reach = int(np.ceil(radius))
        window = covered[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
        disc = _disc(radius, reach)[
            max(reach - row, 0) : max(reach - row, 0) + window.shape[0],
            max(reach - column, 0) : max(reach - column, 0) + window.shape[1],
        ]
        if np.any(disc & (window == 0)):
            window[disc] = 1
            kept.append((column, row, radius))
    return np.array(kept, np.float64)


def local_thickness(mask: Bool[Array, "H W"]) -> Float64[Array, "H W"]:
    """Radius [px] of the thickest body over each pixel of a mask, changing gradually along it."""
    return _thickness_map(mask, _cover(mask)).astype(np.float64)


def _thickness_map(mask: Bool[Array, "H W"], discs: Float64[Array, "K 3"]) -> Float32[Array, "H W"]:
    """Radius of the largest disc over each pixel, smoothed inside the mask."""
    thickness = np.zeros(mask.shape, np.float32)
    for column, row, radius in discs[::-1]:  # ascending: larger ones overwrite
        cv2.circle(thickness, (int(column), int(row)), max(round(radius), 1), float(radius), -1)
    known = (mask & (thickness > 0)).astype(np.float32)
    sigma = 0.25 * float(discs[0, 2]) + 0.5
    smooth = cv2.GaussianBlur(thickness * known, (0, 0), sigma) / np.maximum(
        cv2.GaussianBlur(known, (0, 0), sigma), 1e-6
    )
    thickness_map: Float32[Array, "H W"] = smooth
    return thickness_map


def _disc(radius: float, reach: int) -> Bool[Array, "D D"]:
    offset = np.arange(-reach, reach + 1)
    inside: Bool[Array, "D D"] = offset[:, None] ** 2 + offset[None, :] ** 2 <= radius**2
    return inside
