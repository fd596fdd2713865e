"""Metres: the camera moved towards or away from the object until lengths are right."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float64

from model.reconstruction.silhouette import completed_mask
from model.types import Array, Calibration, Camera, Masks

Extent: TypeAlias = Callable[[Calibration], float]
"""Largest extent [m] of the object, as it would be reconstructed in a calibrated world."""
DEFAULT_SIZE = 0.3
"""Largest extent of an object whose size nobody tells [m]."""


def sized(masks: Masks, calibration: Calibration, size: float, stated: str, extent: Extent) -> Calibration:
    """Move the camera along the ray to the object's foot until the object's largest extent is `size` [m].

    A scale that was known before (the calibration's `scale_source`) is overruled, and a large
    disagreement with it is a warning.
    """
    ratio = size / extent(calibration)
    before, doubts = calibration.scale_source, calibration.warnings
    source = f"{stated}: the object's largest extent is {size:g} m"
    if before:
        source += f" (instead of {before})"
        if not 0.8 < ratio < 1.25:
            doubts += (f"the stated size is {ratio:.2f} times what follows from {before}",)
    foot = foot_of(calibration.camera, masks.object[masks.keyframe], calibration.ground_height or 0.0)
    return replace(
        calibration, camera=_moved(calibration.camera, foot, ratio), scale_source=source, warnings=doubts
    )


def floating(
    masks: Masks,
    calibration: Calibration,
    size_m: float | None,
    extent: Extent,
    measured: float | None = None,
) -> Calibration:
    """Without a ground: the object's middle becomes the origin.

    Args:
        masks: Object and hand.
        calibration: Its camera's rotation is kept, its position is not.
        size_m: Largest extent of the object [m], if stated.
        extent: Measures it.
        measured: Depth of the object [m], if known; it overrules a stated size, with a warning.
    """
    mask = completed_mask(masks.object[masks.keyframe], masks.hand[masks.keyframe])
    camera = _facing(calibration.camera, mask, 1.0)
    if measured is not None:
        camera, doubts = _facing(camera, mask, measured), calibration.warnings + ignored(size_m)
        return replace(calibration, camera=camera, scale_source="depth in millimetres", warnings=doubts)
    size = size_m or DEFAULT_SIZE
    depth = size / extent(replace(calibration, camera=camera))
    stated = "stated" if size_m is not None else "assumed"
    source = f"{stated}: the object's largest extent is {size:g} m"
    return replace(calibration, camera=_facing(camera, mask, depth), scale_source=source)


def ignored(size_m: float | None) -> tuple[str, ...]:
    """What to say of a size that is stated (or not) where depth measures lengths."""
    return () if size_m is None else (f"the stated size of {size_m:g} m is ignored: depth measures lengths",)


def foot_of(camera: Camera, mask: Bool[Array, "H W"], ground: float) -> Float64[Array, " 3"]:
    """Where the ray through the middle of a mask meets the ground [m]."""
    ray = camera.unproject(_middle(mask), np.ones(1))[0] - camera.position
    foot: Float64[Array, " 3"] = camera.position + ray * (ground - camera.position[2]) / ray[2]
    return foot


def centred(camera: Camera, mask: Bool[Array, "H W"]) -> Camera:
    """The camera in a world whose origin lies on the ground (z = 0) below the object."""
    pose = camera.world_from_camera.copy()
    pose[:2, 3] -= foot_of(camera, mask, 0.0)[:2]
    return replace(camera, world_from_camera=pose)


def meets(camera: Camera, mask: Bool[Array, "H W"], ground: float) -> bool:
    """Whether all rays of a mask meet the ground in front of the camera, and not far off at the horizon."""
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
    slope = rays[:, 2] / np.linalg.norm(rays, axis=-1)
    return bool(camera.position[2] > ground and slope.max() < -np.sin(np.deg2rad(3.0)))


def _moved(camera: Camera, about: Float64[Array, " 3"], ratio: float) -> Camera:
    pose = camera.world_from_camera.copy()
    pose[:3, 3] = about + (pose[:3, 3] - about) * ratio
    return replace(camera, world_from_camera=pose)


def _facing(camera: Camera, mask: Bool[Array, "H W"], depth: float) -> Camera:
    """The camera placed so that the mask's middle at `depth` [m] is the origin."""
    pose = camera.world_from_camera.copy()
    pose[:3, 3] = 0.0
    turned = replace(camera, world_from_camera=pose.copy())
    pose[:3, 3] = -turned.unproject(_middle(mask), np.array([depth]))[0]
    return replace(camera, world_from_camera=pose)


def _middle(mask: Bool[Array, "H W"]) -> Float64[Array, "1 2"]:
    rows, columns = np.nonzero(mask)
    return np.array([[columns.mean(), rows.mean()]])
