"""A table with a soft texture, and a dim room behind it."""

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from model.types import Array, Camera

EDGE = 0.60
"""Where the table ends, away from the camera: y [m]."""
TOP, ROOM = np.array([0.37, 0.41, 0.47]), np.array([0.17, 0.165, 0.16])
PATCH = 2.0
"""Side of the square that the texture covers, centred at the origin [m]; it repeats by reflection."""


def table_view(
    camera: Camera,
    rng: np.random.Generator,
    top: Float64[Array, " 3"] = TOP,
    room: Float64[Array, " 3"] = ROOM,
) -> tuple[Float32[Array, "H W 3"], Float32[Array, "H W"]]:
    """What the camera sees of an empty table at z = 0, and where the table is (0..1).

    Args:
        camera: Looks towards +y.
        rng: For the texture of the table and the shapes in the room.
        top: Colour of the table, RGB, 0..1.
        room: Colour of what is behind it.
    """
    y, x = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    ray = camera.unproject(np.stack([x, y], axis=-1), np.ones(x.shape)) - camera.position
    downward = ray[..., 2] < -1e-6
    reach = np.where(downward, -camera.position[2] / np.where(downward, ray[..., 2], -1.0), 0.0)
    spot = camera.position[:2] + reach[..., None] * ray[..., :2]
    wood = _sampled(_texture(rng), spot)
    # A lamp above and to the left: the light falls off across the table.
    falloff = 1.06 - 0.22 * np.hypot(spot[..., 0] + 0.25, spot[..., 1] - 0.1)
    lighted = top * wood * falloff[..., None]
    on_table = downward & (spot[..., 1] < EDGE)
    coverage = cv2.GaussianBlur(on_table.astype(np.float64), (0, 0), 0.8)
    view = coverage[..., None] * lighted + (1 - coverage[..., None]) * room_view(camera, rng, room)
    return view.clip(0, 1).astype(np.float32), np.asarray(coverage, np.float32)


def _texture(rng: np.random.Generator) -> Float64[Array, "S S 3"]:
    """Brightness around 1: broad blotches, faint streaks along x, and a fine grain."""
    size = 1600
    blotches = cv2.resize(rng.normal(0, 1, (14, 14)), (size, size), interpolation=cv2.INTER_CUBIC)
    streaks = cv2.GaussianBlur(rng.normal(0, 1, (size, size)), (0, 0), sigmaX=40, sigmaY=1.6)
    grain = cv2.GaussianBlur(rng.normal(0, 1, (size, size)), (0, 0), 1.2)
    layers = ((blotches, 0.018), (streaks, 0.013), (grain, 0.010))
    value = 1 + sum(amount * layer / layer.std() for layer, amount in layers)
    tint = cv2.resize(rng.normal(0, 0.006, (8, 8, 3)), (size, size), interpolation=cv2.INTER_CUBIC)
    textured: Float64[Array, "S S 3"] = value[..., None] * (1 + tint)
    return textured


def _sampled(texture: Float64[Array, "S S 3"], spot: Float64[Array, "H W 2"]) -> Float64[Array, "H W 3"]:
    """The texture at places on the table [m]."""
    place = ((spot / PATCH + 0.5) * len(texture)).clip(-1e4, 1e4).astype(np.float32)
    sampled: Float64[Array, "H W 3"] = cv2.remap(
        texture, place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return sampled


def room_view(
    camera: Camera, rng: np.random.Generator, room: Float64[Array, " 3"] = ROOM
) -> Float64[Array, "H W 3"]:
    """Out of focus: a few cupboards' worth of large dark shapes."""
    shapes = np.ones((camera.height, camera.width, 3)) * room
    for _ in range(9):
        left = int(rng.integers(-80, camera.width))
        right = left + int(rng.integers(50, 190))
        shapes[:, max(left, 0) : max(right, 0)] *= rng.uniform(0.6, 1.35) * rng.uniform(0.95, 1.05, 3)
    blurred: Float64[Array, "H W 3"] = cv2.GaussianBlur(shapes, (0, 0), 6)
    return blurred
