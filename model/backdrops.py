"""What a rendered twin stands before: the clip's scene without the object, or a plain studio."""

import cv2
import numpy as np
from jaxtyping import Float, Float32

from model.types import Array, Camera, Frames, Masks

DIM, SATURATION = 0.62, 0.35
"""How bright and how colourful a plate of the clip's scene stays: the twin has to stand out."""
PLATE_FRAMES = 24
"""Frames that a plate is the median of."""
SKY, FLOOR = (0.93, 0.94, 0.95), (0.80, 0.82, 0.84)
GRID = 0.05
"""Spacing of the studio's floor lines [m]."""
SHADOW, LEAN = 0.45, (0.25, 0.35)
"""How dark a shadow gets, and how far the light throws it (x, y) per metre of height."""
PENUMBRA = 0.06
"""Height [m] over which a shadow gets blurred."""


def plate(frames: Frames, masks: Masks, width: int, height: int) -> Float32[Array, "h w 3"]:
    """The clip's scene without object and hand, dimmed; RGB, 0..1.

    Every pixel is the median over the frames that show the scene there; what is never seen is filled
    in from its surroundings.
    """
    chosen = np.unique(np.linspace(0, len(frames.images) - 1, PLATE_FRAMES).round().astype(int))
    images = np.stack([_resized(frames.images[t] / np.float32(255), width, height) for t in chosen])
    grown = np.ones((5, 5), np.uint8)
    moving = (masks.object | masks.hand)[chosen].astype(np.float32)
    hidden = np.stack([cv2.dilate(_resized(mask, width, height), grown) > 0 for mask in moving])
    images[hidden] = np.nan
    never = hidden.all(axis=0)
    images[:, never] = 0
    seen = np.asarray(np.nanmedian(images, axis=0) * 255, np.uint8)
    unseen = np.asarray(never, np.uint8)
    filled = np.asarray(cv2.inpaint(seen, unseen, 5, cv2.INPAINT_TELEA), np.float32) / 255
    soft = cv2.GaussianBlur(filled, (0, 0), 1.5)
    grey = soft.mean(axis=2, keepdims=True)
    dimmed: Float32[Array, "h w 3"] = np.float32(DIM) * (grey + np.float32(SATURATION) * (soft - grey))
    return dimmed


def _resized(image: Float32[Array, "*s"], width: int, height: int) -> Float32[Array, "*t"]:
    resized: Float32[Array, "*t"] = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return resized


def studio(camera: Camera, ground_height: float | None) -> Float32[Array, "h w 3"]:
    """A light, empty room; with a ground, its floor has lines every 5 cm that fade with the distance."""
    y, x = np.mgrid[: camera.height, : camera.width]
    fade = (y / max(camera.height - 1, 1))[..., None]
    room = (1 - fade) * np.array(SKY) + fade * (np.array(SKY) - 0.06)
    plain: Float32[Array, "h w 3"] = room.astype(np.float32)
    if ground_height is None:
        return plain
    ray = camera.unproject(np.stack([x, y], axis=-1).astype(np.float64), np.ones(x.shape)) - camera.position
    drop = ground_height - camera.position[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[..., 2] * drop > 0, drop / ray[..., 2], np.inf)
        spot = camera.position[:2] + reach[..., None] * ray[..., :2]
    nearest = float(reach.min())
    if not np.isfinite(nearest):
        return plain
    spot = np.where(np.isfinite(spot), spot, 0.0)
    haze = np.where(np.isfinite(reach), np.exp(-np.maximum(reach / nearest - 1.0, 0) / 1.5), 0.0)[..., None]
    # A pixel's size on the floor decides how sharply a line may be drawn there.
    footprint = np.maximum(reach / camera.intrinsics[0, 0], 1e-6)[..., None]
    off = np.abs(spot / GRID - np.round(spot / GRID)) * GRID
    line = np.clip(1.2 - off / footprint, 0, 1).max(axis=-1, keepdims=True)
    line *= np.clip(GRID / footprint / 6 - 0.5, 0, 1)
    floor = np.array(FLOOR) * (1 - 0.1 * line)
    floored: Float32[Array, "h w 3"] = (haze * floor + (1 - haze) * room).astype(np.float32)
    return floored


def shade(
    backdrop: Float32[Array, "h w 3"],
    means: Float[Array, "G 3"],
    volumes: Float[Array, " G"],
    ground_height: float,
    camera: Camera,
) -> Float32[Array, "h w 3"]:
    """The backdrop with the soft shadow that Gaussians at `means` [m] throw on the ground."""
    height = np.maximum(means[:, 2] - ground_height, 0)
    spot = np.stack(
        [means[:, 0] + LEAN[0] * height, means[:, 1] + LEAN[1] * height, np.full_like(height, ground_height)],
        axis=1,
    )
    pixels, depth = camera.project(spot)
    coarse = 4
    shape = (-(-camera.height // coarse), -(-camera.width // coarse))
    place = np.floor((pixels + 0.5) / coarse)
    inside = (depth > 0) & (place >= 0).all(axis=1) & (place < [shape[1], shape[0]]).all(axis=1)
    column, row = place[inside].astype(np.int64).T
    # Area of the shadow in coarse pixels: a lump of this volume is about this wide.
    area = (np.cbrt(volumes[inside]) * camera.intrinsics[0, 0] / depth[inside] / coarse) ** 2
    sharp = np.exp(-height[inside] / PENUMBRA)
    density = np.zeros(shape, np.float32)
    for share, blur in ((sharp, 1.0), (1 - sharp, 4.0)):
        cover = np.bincount(row * shape[1] + column, weights=share * area, minlength=shape[0] * shape[1])
        blur *= max(1.0, camera.width / coarse / 110)
        density += cv2.GaussianBlur(cover.reshape(shape).astype(np.float32), (0, 0), blur)
    dark = SHADOW * (1 - np.exp(-1.5 * density))
    dark = cv2.resize(dark, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)
    shaded: Float32[Array, "h w 3"] = backdrop * (1 - np.clip(dark, 0, 1)[..., None])
    return shaded
