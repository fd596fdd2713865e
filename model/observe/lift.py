"""Pixels and the depth of a twin → places in the world."""

import numpy as np
from jaxtyping import Bool, Float32, Float64

from model.bundle import TwinBundle
from model.types import Array, Camera


def lift(
    camera: Camera, pixels: Float32[Array, "T N 2"], moved: Float32[Array, "T N 3"]
) -> Float32[Array, "T N 3"]:
    """Where `pixels` [px] are in the world [m] at the depth of the points `moved` [m]."""
    _, depth = camera.project(moved)
    return camera.unproject(pixels, depth).astype(np.float32)


def inside_masks(mask: Bool[Array, "T H W"], pixels: Float32[Array, "T N 2"]) -> Bool[Array, "T N"]:
    """Whether each pixel is inside its frame and inside the mask there."""
    height, width = mask.shape[1:]
    whole = np.nan_to_num(pixels, nan=-1.0).round().astype(np.int64)
    x, y = whole[..., 0], whole[..., 1]
    within: Bool[Array, "T N"] = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    frame = np.broadcast_to(np.arange(len(mask))[:, None], x.shape)
    within[within] = mask[frame[within], y[within], x[within]]
    return within


def controllers_at(twin: TwinBundle, times: Float64[Array, " T"]) -> Float32[Array, "T C 3"]:
    """The recorded motion of the hand at `times`; where nothing was recorded, it stays where it is."""
    if twin.controls is None or twin.manifest.source.fps is None:
        still: Float32[Array, "T C 3"] = np.repeat(twin.topology.controller_points[None], len(times), axis=0)
        return still
    known = np.arange(len(twin.controls)) / twin.manifest.source.fps
    flat = twin.controls.reshape(len(known), -1)
    columns = [np.interp(times, known, flat[:, k]) for k in range(flat.shape[1])]
    motion = np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))
    return motion.reshape(len(times), -1, 3).astype(np.float32)
