"""RGB-D: the measured front of the object, completed to a body behind it."""

from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy import ndimage
from scipy.spatial import cKDTree

from model.errors import InputError
from model.reconstruction.balls import flatness_of
from model.reconstruction.base import Reconstructor
from model.reconstruction.depth_file import read_depth
from model.reconstruction.discs import local_thickness
from model.reconstruction.fill import TARGET_COUNT, Filling, fill, sheet_filling, thinned
from model.reconstruction.outline import overlap, silhouette_of
from model.reconstruction.paint import colors_from_image
from model.reconstruction.silhouette import SHEET_THICKNESS, completed_mask, silhouette_extent
from model.reconstruction.volume import Volume, carved, grid_around, mask_distance, sample_image
from model.types import Array, Calibration, Camera, Frames, Gaussians, Masks, ShapeClass

LYING = 0.3
"""An object lies on the ground whose visible surface comes nearer to it, over its longest side, than this and
what is below the rim of a ball that lies there."""
FLYING = 0.02
"""A pixel that differs from its neighbourhood's median by more than this share of its depth flies."""
NOISE = 0.02
"""A sheet that lies on the ground is measured at most this far below it [m]."""


class DepthReconstructor(Reconstructor):
    """Back-projects the object's depth and completes the side that the camera does not see.

    Behind each visible point the body is as thick as a round body with this outline would be there, but
    ends on the ground. Sheets get one layer on the measured surface. Lengths are those of the depth.

    Args:
        path: One depth image of the keyframe, or a folder with one per frame; see `depth_file.read_depth`.
    """

    name: ClassVar[str] = "depth"
    version: ClassVar[str] = "1"

    def __init__(self, path: Path | str) -> None:
        """Remember where the depth lies; it is read for the keyframe only."""
        self.path = Path(path)

    def keyframe_depth(self, frames: Frames, masks: Masks) -> Float64[Array, "H W"]:
        """Depth of the keyframe [m], 0 = missing: also what `calibrate` takes."""
        height, width = frames.images.shape[1:3]
        number = frames.number(masks.keyframe)
        return read_depth(self.path, number, frames.length, height, width, frames.source_size)

    def __call__(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> Gaussians:
        """Reconstruct the object on the keyframe.

        Raises:
            InputError: the depth does not fit the clip, hardly any of the object was measured, or most of
                it lies below the ground.
        """
        object_mask = masks.object[masks.keyframe]
        mask = completed_mask(object_mask, masks.hand[masks.keyframe])
        front, measured = surface_depth(self.keyframe_depth(frames, masks), object_mask, mask)
        if measured < 0.2:
            raise InputError(
                f"{self.path}: only {measured:.0%} of the object has a depth; use silhouette instead"
            )
        camera = calibration.camera
        pixel = float(np.median(front[mask])) / float(camera.intrinsics[0, 0])
        # A body needs a pixel's worth of height; a sheet may lie on the ground itself.
        above = share_above_ground(
            front, mask, calibration, -NOISE if shape_class == "sheet" else 0.5 * pixel
        )
        if above < 0.5:
            raise InputError(
                f"{self.path}: only {above:.0%} of the object's depth lies above the ground; check the depth "
                "and the camera file's pose and ground_height, or give --shape sheet if the object lies flat"
            )
        if shape_class == "sheet":
            filling = _sheet(front, mask, camera)
        else:
            volume = body_behind(front, mask, calibration)
            filling = fill(volume, pixel, floor=calibration.ground_height)
        colors = colors_from_image(filling, camera, frames.images[masks.keyframe], object_mask)
        doubts: tuple[str, ...] = ()
        if measured < 0.7:
            doubts += (f"{1 - measured:.0%} of the object has no usable depth and was filled from around it",)
        gaussians = filling.painted(colors, doubts)
        score = overlap(silhouette_of(gaussians, camera), mask)
        if score >= 0.9:
            return gaussians
        note = f"the reconstruction covers the keyframe's mask with an overlap of only {score:.2f}"
        return filling.painted(colors, (*doubts, note))

    def extent(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> float:
        """Largest extent [m] of the silhouette; its size is not asked for where depth measures it."""
        return silhouette_extent(masks, calibration, shape_class)


def surface_depth(
    depth: Float[Array, "H W"], object_mask: Bool[Array, "H W"], mask: Bool[Array, "H W"]
) -> tuple[Float64[Array, "H W"], float]:
    """Depth of the object's visible surface in all of `mask` [m], and the share that was measured.

    Flying pixels at edges (mixtures of object and background) and strays far from the rest of the object
    are dropped; what is missing is taken from the nearest measured pixel and smoothed.
    """
    valid = object_mask & (depth > 0)
    if not valid.any():
        return np.zeros(depth.shape), 0.0
    filled = _nearest_filled(depth, valid)
    middle = cv2.medianBlur(filled.astype(np.float32), 5)
    valid &= np.abs(depth - middle) < FLYING * depth
    inner = ndimage.binary_erosion(object_mask, iterations=1)
    if np.count_nonzero(valid & inner) > 0.5 * np.count_nonzero(valid):
        valid &= inner
    low, high = np.quantile(depth[valid], [0.02, 0.98]) if valid.any() else (0.0, 0.0)
    margin = 0.5 * (high - low) + 0.01
    valid &= (depth > low - margin) & (depth < high + margin)
    if not valid.any():
        return np.zeros(depth.shape), 0.0
    share = float(np.count_nonzero(valid)) / int(np.count_nonzero(inner if inner.any() else object_mask))
    front = _nearest_filled(depth, valid)
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.2)
    smooth = cv2.GaussianBlur(np.where(mask, front, 0.0).astype(np.float32), (0, 0), 1.2)
    smooth = smooth / np.maximum(weight, 1e-6)
    return np.where(mask, smooth, front).astype(np.float64), min(share, 1.0)


def share_above_ground(
    front: Float64[Array, "H W"], mask: Bool[Array, "H W"], calibration: Calibration, height: float
) -> float:
    """Share of the visible surface that lies at least `height` [m] above the ground."""
    if calibration.ground_height is None:
        return 1.0
    rows, columns = np.nonzero(mask)
    points = calibration.camera.unproject(np.stack([columns, rows], -1).astype(np.float64), front[mask])
    return float((points[:, 2] >= calibration.ground_height + height).mean())


def body_behind(front: Float64[Array, "H W"], mask: Bool[Array, "H W"], calibration: Calibration) -> Volume:
    """The volume between the visible surface and a rounded back, above the ground.

    Of what lies on the ground the underside is not seen, and no back reaches it: what is below the body is
    filled, as far as the outline and the visible surface allow.
    """
    camera, ground = calibration.camera, calibration.ground_height
    focal = float(camera.intrinsics[0, 0])
    inscribed = np.maximum(mask_distance(mask), 0.0)
    widest = local_thickness(mask)
    # A round section: a chord of the circle with the local radius, at this distance from its rim.
    chord = 2.0 * np.sqrt(np.maximum(widest**2 - (widest - np.minimum(inscribed, widest)) ** 2, 0.0))
    thickness = np.maximum(flatness_of(mask) * chord * front / focal, 2.0 * front / focal)
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    near = camera.unproject(pixels, front[mask])
    far = camera.unproject(pixels, (front + thickness)[mask])
    corners = np.concatenate([near, far])
    lies = ground is not None and _lies(near, ground, camera)
    if ground is not None:
        corners[:, 2] = np.maximum(corners[:, 2], ground)
        if lies:
            corners[0, 2] = ground
    pixel = float(np.median(front[mask])) / focal
    shape, origin, spacing = grid_around(corners.min(0), corners.max(0), np.eye(3), 0.5 * pixel)
    volume = Volume(np.zeros(shape, np.float32), origin, np.eye(3), spacing)
    points = volume.points
    seen, depth = camera.project(points)
    seen = np.clip(seen, -1e4, 1e4)
    behind = depth - sample_image(front, seen)
    before = sample_image(front + thickness, seen) - depth
    distance = np.minimum(behind, before)
    if ground is not None:
        height = points[..., 2] - ground
        if lies:
            distance = np.minimum(_filled_below(distance, height), behind)
        distance = np.minimum(distance, height)
    rough = Volume(distance.astype(np.float32), origin, np.eye(3), spacing)
    body = carved(rough, mask, camera)
    smooth = ndimage.gaussian_filter(body.distance, 0.7)
    return Volume(smooth, origin, np.eye(3), spacing)


def _filled_below(
    distance: Float64[Array, "X Y Z"], height: Float64[Array, "X Y Z"]
) -> Float64[Array, "X Y Z"]:
    """A body and what is below it, down to an underside half as round as the top.

    Args:
        distance: To the surface, above 0 inside [m].
        height: Over the ground [m], last along Z.
    """
    top = np.where(distance > 0.0, height, 0.0).max(-1)
    below = height - 0.5 * (top.max() - top)[..., None]
    above = np.maximum.accumulate(distance[..., ::-1], axis=-1)[..., ::-1]
    filled: Float64[Array, "X Y Z"] = np.maximum(distance, np.minimum(above, below))
    return filled


def _lies(seen: Float64[Array, "N 3"], ground: float, camera: Camera) -> bool:
    """Whether what is seen of an object comes as near the ground as that of one that lies on it.

    Of a ball that the camera looks down at by an angle p the lowest that is seen is r (1 - cos p) high.
    """
    down = float(np.clip(camera.world_from_camera[2, 2], -1.0, 1.0))
    rim = 0.5 * (1.0 - float(np.sqrt(1.0 - down**2)))
    lowest = float(np.percentile(seen[:, 2], 1)) - ground
    return lowest < (LYING + rim) * float(np.ptp(seen, axis=0).max())


def _sheet(front: Float64[Array, "H W"], mask: Bool[Array, "H W"], camera: Camera) -> Filling:
    """One layer on the measured surface, each Gaussian facing as its neighbourhood does."""
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    points = camera.unproject(pixels, front[mask])
    normals = _normals(points, camera)
    towards = points - camera.position
    distance = np.linalg.norm(towards, axis=-1)
    cosine = np.maximum(np.abs(np.einsum("ni,ni->n", normals, towards)) / distance, 0.15)
    area = float(((front[mask] / camera.intrinsics[0, 0]) ** 2 / cosine).sum())
    spacing = float(np.sqrt(area / TARGET_COUNT))
    # Finer than the pixels: repeat them with offsets inside the pixel before thinning.
    repeats = max(1, round(2.0 * TARGET_COUNT / len(points)) + 1)
    rng = np.random.default_rng(0)
    dense = np.concatenate(
        [
            camera.unproject(pixels + offset, sample_image(front, pixels + offset))
            for offset in rng.uniform(-0.5, 0.5, (repeats, len(pixels), 2))
        ]
    )
    kept = thinned(dense, 0.85 * spacing)
    means = dense[kept]
    _, nearest = cKDTree(points).query(means)
    filling = sheet_filling(means, normals[nearest], spacing, SHEET_THICKNESS)
    share = np.full(len(means), area * SHEET_THICKNESS / len(means))
    return Filling(means, filling.normals, filling.scales, share, spacing)


def _normals(points: Float64[Array, "N 3"], camera: Camera) -> Float64[Array, "N 3"]:
    """Unit normals towards the camera, from the plane through the nearest points."""
    _, neighbours = cKDTree(points).query(points, k=min(24, len(points)))
    local = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))[1][..., 0]
    away = np.einsum("ni,ni->n", normals, points - camera.position) > 0
    facing: Float64[Array, "N 3"] = np.where(away[:, None], -normals, normals)
    return facing


def _nearest_filled(values: Float[Array, "H W"], valid: Bool[Array, "H W"]) -> Float64[Array, "H W"]:
    """Values with invalid pixels replaced by the nearest valid one."""
    index = ndimage.distance_transform_edt(~valid, return_distances=False, return_indices=True)
    filled: Float64[Array, "H W"] = np.asarray(values, np.float64)[index[0], index[1]]
    return filled
