"""Inscribed balls: the silhouette as a union of round bodies that rest on the ground or hang in the air."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy import ndimage

from model.reconstruction.discs import inscribed
from model.reconstruction.volume import Volume, grid_around
from model.types import Array, Camera

CUSHION, BALL = 0.38, 0.85
"""Thickness to width of bodies as wide as long: with corners in the outline, and with a round one."""


@dataclass(frozen=True)
class Balls:
    """Oblate ellipsoids: equal across, flattened along one common axis."""

    centers: Float64[Array, "K 3"]
    """[m]."""
    radii: Float64[Array, " K"]
    """Across the axis [m]."""
    axis: Float64[Array, " 3"]
    """Unit vector along which they are flattened: the ground's normal, or towards the camera."""
    flatness: float
    """Radius along the axis over radius across it."""

    @property
    def extent(self) -> float:
        """Largest extent of the body they make [m]."""
        directions = _sphere_directions(400)
        along = directions @ self.axis
        support = np.sqrt(1.0 - along**2 * (1.0 - self.flatness**2))
        reach = self.centers @ directions.T
        widths = (reach + self.radii[:, None] * support).max(0) - (reach - self.radii[:, None] * support).min(
            0
        )
        return float(widths.max())


def flatness_of(mask: Bool[Array, "H W"]) -> float:
    """Thickness over width that a body with this outline probably has.

    Limbs and ropes are round; the wider a body is for its length, the flatter it lies, unless its outline
    is a circle. A stated assumption: one view does not show thickness.
    """
    widest = float(cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5).max())
    pixels = np.argwhere(mask).astype(np.float32)
    length = 2.0 * cv2.minEnclosingCircle(pixels)[1] + 1.0
    roundness = 4.0 * len(pixels) / (np.pi * length**2)
    broad = float(np.interp(roundness, [0.65, 0.9], [CUSHION, BALL]))
    return float(np.interp(widest / length, [0.08, 0.32], [1.0, broad]))


def resting_balls(mask: Bool[Array, "H W"], camera: Camera, flatness: float, ground_height: float) -> Balls:
    """Balls that lie on the ground z = `ground_height` [m] and project onto `mask`.

    Each ball is inscribed in the outline; its middle is as high as the thickest ball around it needs to
    rest on the ground, so a limb's middle line is one radius up and the outline is kept from any pitch.
    """
    axis = np.array([0.0, 0.0, 1.0])
    rows, columns = np.nonzero(mask)
    middle = np.array([[columns.mean(), rows.mean()]])
    anchor = plane_points(camera, middle, axis, ground_height)[0]
    direction, squeeze = _foreshortening(camera, anchor, axis, flatness)
    discs = inscribed(mask, direction, squeeze)
    focal = _focal(camera)
    centers = plane_points(camera, discs.centers, axis, np.full(len(discs.radii), ground_height))
    for _ in range(4):  # the height depends on the depth and the depth on the height: a contraction
        depth = camera.to_camera(centers)[:, 2]
        height = ground_height + flatness * discs.thickness * depth / focal
        centers = plane_points(camera, discs.centers, axis, height)
    # What lies within a larger disc belongs to the outline of its ball: the ball's polar plane holds it.
    onto = _polar_points(camera, discs.centers, centers[discs.owners], axis, flatness)
    centers = discs.nested[:, None] * onto + (1.0 - discs.nested[:, None]) * centers
    depth = camera.to_camera(centers)[:, 2]
    return Balls(centers, discs.radii * depth / focal, axis, flatness)


def floating_balls(mask: Bool[Array, "H W"], camera: Camera, flatness: float, depth: float) -> Balls:
    """Balls whose middles lie at `depth` [m] from the camera and that project onto `mask`."""
    discs = inscribed(mask, np.array([1.0, 0.0]), 1.0)
    centers = camera.unproject(discs.centers, np.full(len(discs.radii), depth))
    return Balls(centers, discs.radii * depth / _focal(camera), -camera.forward, flatness)


def plane_points(
    camera: Camera, pixels: Float[Array, "K 2"], normal: Float64[Array, " 3"], offset: float | Array
) -> Float64[Array, "K 3"]:
    """Where the rays of pixels meet the plane(s) normal·x = offset [m]; the horizon is capped far away."""
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
    slope = rays @ normal
    gap = offset - camera.position @ normal
    parameter = gap / np.where(np.abs(slope) < 1e-9, 1e-9, slope)
    cap = 50.0 * np.abs(gap) + 1e-9
    parameter = np.where((parameter > 0) & (parameter < cap), parameter, cap)
    points: Float64[Array, "K 3"] = camera.position + parameter[:, None] * rays
    return points


def _polar_points(
    camera: Camera,
    pixels: Float64[Array, "K 2"],
    middles: Float64[Array, "K 3"],
    axis: Float64[Array, " 3"],
    flatness: float,
) -> Float64[Array, "K 3"]:
    """Where the rays of pixels meet the planes through the outlines of balls as the camera sees them."""
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
    normals = rays + (flatness**-2 - 1.0) * (rays @ axis)[:, None] * axis
    parameter = np.einsum("ki,ki->k", middles - camera.position, normals) / np.einsum(
        "ki,ki->k", rays, normals
    )
    points: Float64[Array, "K 3"] = camera.position + parameter[:, None] * rays
    return points


def inflate(balls: Balls, axes: Float64[Array, "3 3"], finest: float) -> Volume:
    """The union of balls as a volume on a grid with the given axes; `finest` is its least spacing [m]."""
    local = balls.centers @ axes
    reach = balls.radii[:, None]
    shape, origin, spacing = grid_around((local - reach).min(0), (local + reach).max(0), axes, finest)
    distance = np.full(shape, -10.0 * spacing, np.float32)
    volume = Volume(distance, origin, axes, spacing)
    paint_balls(volume, balls)
    smooth = ndimage.gaussian_filter(volume.distance, 0.7)
    return Volume(smooth, origin, axes, spacing)


def paint_balls(volume: Volume, balls: Balls) -> None:
    """Raise a volume's distance where balls are, in place."""
    index = (balls.centers - volume.origin) @ volume.axes / volume.spacing
    along_axis = volume.axes.T @ balls.axis
    counts = np.array(volume.distance.shape)
    for center, radius in zip(index, balls.radii / volume.spacing, strict=True):
        low = np.maximum(np.floor(center - radius - 2).astype(int), 0)
        high = np.minimum(np.ceil(center + radius + 3).astype(int), counts)
        if np.any(high <= low):
            continue
        box = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        offset = [
            (np.arange(a, b) - c).reshape([-1 if i == j else 1 for j in range(3)])
            for i, (a, b, c) in enumerate(zip(low, high, center, strict=True))
        ]
        squared = offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2
        along = offset[0] * along_axis[0] + offset[1] * along_axis[1] + offset[2] * along_axis[2]
        scaled = np.sqrt(np.maximum(squared + along**2 * (balls.flatness**-2 - 1.0), 0.0))
        inside = (radius - scaled) * (balls.flatness if balls.flatness < 1 else 1.0) * volume.spacing
        volume.distance[box] = np.maximum(volume.distance[box], inside)


def _foreshortening(
    camera: Camera, anchor: Float64[Array, " 3"], axis: Float64[Array, " 3"], flatness: float
) -> tuple[Float64[Array, " 2"], float]:
    """Image direction and factor by which a flattened ball at `anchor` looks shorter than it is wide."""
    ray = anchor - camera.position
    ray = ray / np.linalg.norm(ray)
    steepness = abs(float(ray @ axis))
    step = 1e-3 * float(np.linalg.norm(anchor - camera.position))
    ends, _ = camera.project(np.stack([anchor, anchor + step * axis]))
    towards = ends[1] - ends[0]
    norm = float(np.linalg.norm(towards))
    direction = towards / norm if norm > 1e-6 else np.array([0.0, -1.0])
    return direction, float(np.sqrt(steepness**2 + flatness**2 * (1.0 - steepness**2)))


def _focal(camera: Camera) -> float:
    return float(np.sqrt(camera.intrinsics[0, 0] * camera.intrinsics[1, 1]))


def _sphere_directions(count: int) -> Float64[Array, "D 3"]:
    """Even directions over half a sphere (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = index / count
    angle = np.pi * (1.0 + 5.0**0.5) * index
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=-1)
