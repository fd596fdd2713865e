"""Small image patches, many at a time, and how far each has drifted from its reference."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8

from model.types import Array

HALF = 12
"""Half the patch side [px]."""
_SIDE = 2 * HALF + 1
_COLUMNS = 20
_WINDOW = (15, 15)
_FLAT = 2.0
"""Below this standard deviation [grey levels] a patch is noise, not texture."""


def cut(
    image: UInt8[Array, "H W"], centres: Float32[Array, "N 2"], affine: Float32[Array, "N 2 2"] | None = None
) -> Float32[Array, "N S S"]:
    """Patches around `centres`; patch coordinates u show the image at `affine @ u + centre`."""
    steps = np.arange(-HALF, HALF + 1, dtype=np.float32)
    x, y = np.meshgrid(steps, steps)
    turn = np.eye(2, dtype=np.float32)[None] if affine is None else affine
    turn, centre = turn[..., None, None], centres[..., None, None]
    columns = np.ascontiguousarray(turn[:, 0, 0] * x + turn[:, 0, 1] * y + centre[:, 0], np.float32)
    rows = np.ascontiguousarray(turn[:, 1, 0] * x + turn[:, 1, 1] * y + centre[:, 1], np.float32)
    # remap takes at most 32767 rows
    chunk = 32_000 // _SIDE
    parts = [
        cv2.remap(
            image,
            columns[i : i + chunk].reshape(-1, _SIDE),
            rows[i : i + chunk].reshape(-1, _SIDE),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for i in range(0, len(centres), chunk)
    ]
    return np.concatenate(parts).reshape(-1, _SIDE, _SIDE).astype(np.float32)


def normalised(patches: Float32[Array, "N S S"]) -> tuple[Float32[Array, "N S S"], Bool[Array, " N"]]:
    """Patches of zero mean and unit deviation (so that light may change), and which have texture."""
    centred = patches - patches.mean(axis=(1, 2), keepdims=True)
    deviation = centred.std(axis=(1, 2), keepdims=True)
    return centred / np.maximum(deviation, _FLAT), deviation[:, 0, 0] > _FLAT


def correlation(first: Float32[Array, "N S S"], second: Float32[Array, "N S S"]) -> Float[Array, " N"]:
    """Normalised cross-correlation of already normalised patches, −1 … 1."""
    score: Float[Array, " N"] = (first * second).mean(axis=(1, 2))
    return score


def residual_shift(
    reference: Float32[Array, "N S S"], current: Float32[Array, "N S S"]
) -> tuple[Float32[Array, "N 2"], Bool[Array, " N"]]:
    """Sub-pixel shift of each current patch against its reference, and where it can be trusted.

    One Lucas-Kanade call serves all: the patches are laid out as one mosaic image. Trusted are
    shifts that lead back when computed the other way round and that are small.
    """
    count = len(reference)
    index = np.arange(count)
    centres = np.stack([(index % _COLUMNS) * _SIDE + HALF, (index // _COLUMNS) * _SIDE + HALF], axis=1)
    centres = centres.astype(np.float32)
    first, second = _mosaic(reference), _mosaic(current)
    forward, found = _flow(first, second, centres)
    back, found_back = _flow(second, first, forward)
    shift = forward - centres
    closed = np.linalg.norm(back - centres, axis=1) < 0.7
    return shift, found & found_back & closed & (np.linalg.norm(shift, axis=1) < 3.0)


def local_affine(
    start: Float32[Array, "N 2"], now: Float32[Array, "N 2"], neighbours: Int[Array, "N k"]
) -> Float32[Array, "N 2 2"]:
    """Least-squares linear map of each point's neighbourhood from `start` to `now`."""
    before, after = start[neighbours], now[neighbours]
    before = before - before.mean(axis=1, keepdims=True)
    after = after - after.mean(axis=1, keepdims=True)
    # a pull to the identity keeps collinear neighbourhoods (a thin rope) solvable
    pull = (1.0 + 0.02 * (before**2).sum(axis=(1, 2)))[:, None, None] * np.eye(2)
    normal = np.einsum("nki,nkj->nij", before, before) + pull
    mixed = np.einsum("nki,nkj->nij", after, before) + pull
    return np.asarray(mixed @ np.linalg.inv(normal), np.float32)


def _mosaic(patches: Float32[Array, "N S S"]) -> UInt8[Array, "h w"]:
    rows = -(-len(patches) // _COLUMNS)
    full = np.zeros((rows * _COLUMNS, _SIDE, _SIDE), np.float32)
    full[: len(patches)] = patches
    tiles = full.reshape(rows, _COLUMNS, _SIDE, _SIDE).swapaxes(1, 2)
    levels: UInt8[Array, "h w"] = (tiles * 40 + 128).clip(0, 255).astype(np.uint8)
    return levels.reshape(rows * _SIDE, _COLUMNS * _SIDE)


def _flow(
    first: UInt8[Array, "h w"], second: UInt8[Array, "h w"], points: Float32[Array, "N 2"]
) -> tuple[Float32[Array, "N 2"], Bool[Array, " N"]]:
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.03)
    begin = points[:, None]
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        first, second, begin, np.empty_like(begin), winSize=_WINDOW, maxLevel=0, criteria=criteria
    )
    return np.asarray(moved[:, 0], np.float32), np.asarray(status[:, 0] > 0)
