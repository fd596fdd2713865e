"""Cameras to look at a twin with: the clip's own at another size, or one placed for the purpose."""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float32

from model.types import Array, Camera

FOCAL = 1.4
"""Focal length of a placed camera, in widths of its image."""
ELEVATION = math.radians(25)
"""How far above the horizon a placed camera stands."""
ROOM = 1.15
"""How much larger than the motion the view of a placed camera is."""


def scaled(camera: Camera, longest_side: int) -> Camera:
    """The same view with at most `longest_side` pixels along its longer side, and even sides."""
    factor = min(1.0, longest_side / max(camera.width, camera.height))
    width, height = (max(2, 2 * round(side * factor / 2)) for side in (camera.width, camera.height))
    stretch = np.diag([width / camera.width, height / camera.height, 1.0])
    # Pixel centres are whole numbers: the corner of the image is at (-0.5, -0.5).
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    intrinsics = np.linalg.inv(half) @ stretch @ half @ camera.intrinsics
    return replace(camera, intrinsics=intrinsics, width=width, height=height)


def look_at(
    eye: Float[Array, " 3"], target: Float[Array, " 3"], focal: float, width: int, height: int
) -> Camera:
    """A camera at `eye` [m] that looks at `target` [m], upright, with a focal length in pixels."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    intrinsics = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]], np.float64)
    return Camera(intrinsics, pose, width, height)


def overview(points: Float32[Array, "*n 3"], width: int = 848, height: int = 480) -> Camera:
    """A camera in front (towards +y) and slightly above that sees all of `points` [m]."""
    flat = np.asarray(points, np.float64).reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    focal = FOCAL * width
    half_angle = math.atan(min(width, height) / 2 / focal)
    distance = max(ROOM * radius / math.sin(half_angle), 0.05)
    direction = np.array([0.0, -math.cos(ELEVATION), math.sin(ELEVATION)])
    return look_at(center + distance * direction, center, focal, width, height)
