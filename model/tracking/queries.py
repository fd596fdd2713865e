"""Which pixels to follow: evenly spread over a mask, and inside the image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import cKDTree

from model.errors import InputError
from model.types import Array

_CANDIDATES = 20_000
_RELAXATIONS = 6


def sample_queries(mask: Bool[Array, "H W"], count: int, seed: int = 0) -> Float32[Array, "N 2"]:
    """Pixels (x, y) of the mask, evenly spread by a centroidal Voronoi relaxation, and distinct.

    The outermost pixels are avoided where the mask is thick enough: a track on the border follows
    the background as easily as the object.

    Args:
        mask: Where queries may lie.
        count: How many are wanted; fewer come back when the mask has fewer pixels.
        seed: Of the random start.

    Reference:
        Lloyd (1982), Least squares quantization in PCM.
    """
    inner = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    chosen = inner if inner.sum() >= max(4 * count, 0.5 * mask.sum()) else mask
    pixels = np.argwhere(chosen)[:, ::-1].astype(np.float32)
    if len(pixels) <= count:
        return pixels
    generator = np.random.default_rng(seed)
    pool = pixels
    if len(pool) > max(_CANDIDATES, 4 * count):
        pool = pool[np.sort(generator.permutation(len(pool))[: max(_CANDIDATES, 4 * count)])]
    centres = pool[np.sort(generator.permutation(len(pool))[:count])]
    for _ in range(_RELAXATIONS):
        owner = cKDTree(centres).query(pool)[1]
        members = np.bincount(owner, minlength=count)
        sums = np.stack([np.bincount(owner, pool[:, axis], minlength=count) for axis in (0, 1)], axis=1)
        centres = np.where(members[:, None] > 0, sums / np.maximum(members, 1)[:, None], centres)
    nearest = np.unique(cKDTree(pool).query(centres)[1])
    return np.ascontiguousarray(pool[nearest], np.float32)


def check_queries(queries: Float32[Array, "N 2"], keyframe: int, count: int, width: int, height: int) -> None:
    """Refuse queries that cannot be tracked.

    Raises:
        InputError: the keyframe is not in the clip, or a query is not finite or not in the image.
    """
    if not 0 <= keyframe < count:
        raise InputError(f"tracking: keyframe {keyframe} is not in the clip of {count} frames")
    inside = np.isfinite(queries) & (queries >= 0) & (queries <= (width - 1, height - 1))
    if not inside.all():
        row = int(np.argmin(inside.all(axis=1)))
        raise InputError(f"tracking: query {row} is not inside the {width}×{height} image")
