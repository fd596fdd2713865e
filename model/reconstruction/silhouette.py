"""One view, no weights: the silhouette inflated to a body that projects back onto it."""

from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Bool, Float64
from scipy import ndimage

from model.errors import InputError
from model.reconstruction.balls import (
    Balls,
    flatness_of,
    floating_balls,
    inflate,
    paint_balls,
    plane_points,
    resting_balls,
)
from model.reconstruction.base import Reconstructor
from model.reconstruction.fill import TARGET_COUNT, Filling, fill, sheet_filling, sheet_inset
from model.reconstruction.outline import overlap, silhouette_of
from model.reconstruction.paint import colors_from_image
from model.reconstruction.volume import Volume, carved, mask_distance, sample_image, without_specks
from model.types import Array, Calibration, Camera, Frames, Gaussians, Masks, ShapeClass

SHEET_THICKNESS = 0.002
"""Of cloth, paper, film [m]: a stated assumption."""
FEWEST = 30
"""An object of fewer pixels than this has no outline."""
UNDER_HAND = 4
"""How far the object is continued under an adjoining hand [px of a 480-line image]."""


class SilhouetteReconstructor(Reconstructor):
    """Inflates the silhouette of the keyframe.

    Solids and ropes become a union of balls inscribed in the outline, resting on the ground (or, without
    a ground, centred at one depth), flattened the more the wider the body is for its length. Sheets
    become one layer on the ground. The body is then carved and completed until it projects onto the mask.

    Reference:
        Blum (1967), A transformation for extracting new descriptors of shape (medial axis); and
        Igarashi et al. (1999), Teddy, on inflating outlines.
    """

    name: ClassVar[str] = "silhouette"
    version: ClassVar[str] = "1"

    def __call__(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> Gaussians:
        """Reconstruct the object on the keyframe."""
        image = frames.images[masks.keyframe]
        check_seen(frames, masks)
        mask = completed_mask(masks.object[masks.keyframe], masks.hand[masks.keyframe])
        filling = (
            _sheet(mask, calibration)
            if shape_class == "sheet"
            else fill(
                body_of(mask, calibration, shape_class),
                pixel_size(mask, calibration),
                calibration.ground_height,
            )
        )
        gaussians = filling.painted(
            colors_from_image(filling, calibration.camera, image, masks.object[masks.keyframe])
        )
        score = overlap(silhouette_of(gaussians, calibration.camera), mask)
        if score < 0.9:
            note = f"the reconstruction covers the keyframe's mask with an overlap of only {score:.2f}"
            return filling.painted(gaussians.colors, (note,))
        return gaussians

    def extent(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> float:
        """Largest extent [m] of the inflated silhouette."""
        return silhouette_extent(masks, calibration, shape_class)


def check_seen(frames: Frames, masks: Masks) -> None:
    """Refuse a keyframe on which the object is too small to have an outline.

    Raises:
        InputError: it covers fewer than `FEWEST` pixels.
    """
    mask = completed_mask(masks.object[masks.keyframe], masks.hand[masks.keyframe])
    if np.count_nonzero(mask) < FEWEST:
        raise InputError(
            f"{frames.name}: the object covers only {np.count_nonzero(mask)} pixels of the keyframe; "
            "choose another keyframe or give another --mask"
        )


def completed_mask(object_mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]) -> Bool[Array, "H W"]:
    """The object's mask continued a few pixels under the hand, and over small gaps that the hand covers."""
    reach = max(1, round(UNDER_HAND * object_mask.shape[0] / 480))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    grown = cv2.dilate(object_mask.astype(np.uint8), disc) > 0
    closed = ndimage.binary_fill_holes(object_mask | (grown & hand))
    candidate = object_mask | (grown & hand) | (closed & hand)
    # Between fingers only threads are left: no part of the object is that thin.
    opened = cv2.morphologyEx(candidate.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0
    completed: Bool[Array, "H W"] = object_mask | opened
    return completed


def balls_of(mask: Bool[Array, "H W"], calibration: Calibration, shape_class: ShapeClass) -> Balls:
    """The balls that a solid or a rope with this silhouette is made of."""
    flatness = 1.0 if shape_class == "rope" else flatness_of(mask)
    if calibration.ground_height is not None:
        return resting_balls(mask, calibration.camera, flatness, calibration.ground_height)
    return floating_balls(mask, calibration.camera, flatness, resting_depth(calibration.camera))


def extent_of(mask: Bool[Array, "H W"], calibration: Calibration, shape_class: ShapeClass) -> float:
    """Largest extent [m] of the body that this silhouette becomes."""
    if shape_class != "sheet":
        return balls_of(mask, calibration, shape_class).extent
    normal, offset = _sheet_plane(calibration, 0.0)
    rows, columns = np.nonzero(mask)
    points = plane_points(
        calibration.camera, np.stack([columns, rows], -1).astype(np.float64), normal, offset
    )
    angle = np.linspace(0.0, np.pi, 180, endpoint=False)
    across = _in_plane(calibration.camera, normal)
    widths = np.ptp(points @ across.T @ np.stack([np.cos(angle), np.sin(angle)]), axis=0)
    return float(widths.max())


def silhouette_extent(masks: Masks, calibration: Calibration, shape_class: ShapeClass) -> float:
    """Largest extent [m] of the body that the keyframe's silhouette, continued under the hand, becomes."""
    mask = completed_mask(masks.object[masks.keyframe], masks.hand[masks.keyframe])
    return extent_of(mask, calibration, shape_class)


def resting_depth(camera: Camera) -> float:
    """Depth [m] of an object that floats: the calibration puts the world's origin into its middle."""
    return float(camera.to_camera(np.zeros((1, 3)))[0, 2])


def body_of(mask: Bool[Array, "H W"], calibration: Calibration, shape_class: ShapeClass) -> Volume:
    """The volume of a solid or rope: inflated, carved to the mask, completed where rays miss it."""
    balls = balls_of(mask, calibration, shape_class)
    camera = calibration.camera
    axes = np.eye(3) if calibration.ground_height is not None else camera.world_from_camera[:3, :3].copy()
    pixel = pixel_size(mask, calibration)
    volume = inflate(balls, axes, 0.5 * pixel)
    for _ in range(2):
        volume = _grounded(carved(volume, mask, camera), calibration.ground_height)
        missing = _missing_balls(volume, mask, camera, balls)
        if missing is None:
            break
        paint_balls(volume, missing)
    return without_specks(_grounded(carved(volume, mask, camera), calibration.ground_height))


def pixel_size(mask: Bool[Array, "H W"], calibration: Calibration) -> float:
    """What a pixel of the object measures [m]."""
    camera, ground = calibration.camera, calibration.ground_height
    depth = resting_depth(camera)
    if ground is not None:
        rows, columns = np.nonzero(mask)
        middle = np.array([[columns.mean(), rows.mean()]])
        depth = float(camera.to_camera(plane_points(camera, middle, np.array([0.0, 0.0, 1.0]), ground))[0, 2])
    return depth / float(camera.intrinsics[0, 0])


def _grounded(volume: Volume, ground_height: float | None) -> Volume:
    """Nothing reaches below the ground."""
    if ground_height is None:
        return volume
    height = volume.points[..., 2] - ground_height
    return Volume(
        np.minimum(volume.distance, height).astype(np.float32), volume.origin, volume.axes, volume.spacing
    )


def _missing_balls(volume: Volume, mask: Bool[Array, "H W"], camera: Camera, balls: Balls) -> Balls | None:
    """Balls for the mask's pixels whose rays miss the volume, each where its ray comes nearest to it."""
    outline = mask_distance(mask)
    rows, columns = np.nonzero(mask & (outline > 0.4))
    pixels = np.stack([columns, rows], -1).astype(np.float64)
    depth = camera.to_camera(balls.centers)[:, 2]
    reach = float(balls.radii.max())
    steps = np.linspace(depth.min() - reach, depth.max() + reach, 72)
    best = np.full(len(pixels), -np.inf)
    where = np.full(len(pixels), steps[0])
    for step in steps:
        inside = volume.sample(camera.unproject(pixels, np.full(len(pixels), step)))
        better = inside > best
        best[better], where[better] = inside[better], step
    focal = float(camera.intrinsics[0, 0])
    wanted = np.minimum(outline[rows, columns] * where / focal, 1.5 * volume.spacing)
    short = best < 0.5 * wanted
    if not short.any():
        return None
    radius = np.maximum(outline[rows, columns] * where / focal, volume.spacing)[short]
    radius = np.minimum(radius, 6 * volume.spacing)
    return Balls(camera.unproject(pixels[short], where[short]), radius, balls.axis, balls.flatness)


def _sheet(mask: Bool[Array, "H W"], calibration: Calibration) -> Filling:
    """One even layer on the ground, or facing the camera where there is no ground."""
    camera = calibration.camera
    normal, offset = _sheet_plane(calibration, 0.5 * SHEET_THICKNESS)
    axes = _in_plane(camera, normal)
    rows, columns = np.nonzero(mask)
    flat = plane_points(camera, np.stack([columns, rows], -1).astype(np.float64), normal, offset) @ axes.T
    area = _footprint_area(mask, camera, normal, offset)
    spacing = float(np.sqrt(area / TARGET_COUNT))
    low, high = flat.min(0), flat.max(0)
    lattice = np.stack(
        np.meshgrid(*(np.arange(a - spacing, b + spacing, spacing) for a, b in zip(low, high, strict=True))),
        -1,
    ).reshape(-1, 2)
    lattice = lattice + np.random.default_rng(0).uniform(-0.1, 0.1, lattice.shape) * spacing
    points = lattice @ axes + offset * normal
    pixels, depth = camera.project(points)
    distance = sample_image(mask_distance(mask), pixels, -10.0) * depth / camera.intrinsics[0, 0]
    points = points[distance > sheet_inset(spacing, pixel_size(mask, calibration))]
    if not len(points):
        raise InputError("the mask is too narrow for a sheet: give another --mask, or --shape rope")
    filling = sheet_filling(points, np.tile(normal, (len(points), 1)), spacing, SHEET_THICKNESS)
    share = area * SHEET_THICKNESS / len(filling.means)
    return Filling(
        filling.means, filling.normals, filling.scales, np.full(len(filling.means), share), spacing
    )


def _sheet_plane(calibration: Calibration, lift: float) -> tuple[Float64[Array, " 3"], float]:
    """Normal and offset [m] of the plane a sheet lies in, `lift` above the ground."""
    camera = calibration.camera
    if calibration.ground_height is not None:
        return np.array([0.0, 0.0, 1.0]), calibration.ground_height + lift
    normal = -camera.forward
    return normal, float(normal @ camera.position) - resting_depth(camera)


def _in_plane(camera: Camera, normal: Float64[Array, " 3"]) -> Float64[Array, "2 3"]:
    """Two unit vectors in a plane, the first along the image's rows."""
    right = camera.world_from_camera[:3, 0]
    across = right - (right @ normal) * normal
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(normal, across)])


def _footprint_area(
    mask: Bool[Array, "H W"], camera: Camera, normal: Float64[Array, " 3"], offset: float
) -> float:
    """Area [m²] on a plane of what a mask covers in the image."""
    rows, columns = np.nonzero(mask)
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    pixels = np.stack([columns, rows], -1)[:, None] + corners
    quad = plane_points(camera, pixels.reshape(-1, 2), normal, offset).reshape(-1, 4, 3)
    crossed = np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
    return float(0.5 * np.linalg.norm(crossed, axis=-1).sum())
