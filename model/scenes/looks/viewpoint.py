"""Cameras: somewhere around what happens, so that all of it is in the picture."""

import numpy as np
from jaxtyping import Float

from model.types import Array, Camera
from model.views import look_at

FILLED = 0.74
"""Share of the picture that the motion fills, along its larger side."""
ELEVATION = (0.42, 0.95)
"""Above the horizon [rad]."""
FOCAL = (1.0, 1.5)
"""In widths of the picture."""
STEPS = 8


def draw_camera(points: Float[Array, "P 3"], size: tuple[int, int], rng: np.random.Generator) -> Camera:
    """A camera on a tripod that sees all of `points` [m], from above by 24 to 54 degrees."""
    width, height = size
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    target = (low + high) / 2
    elevation, around = rng.uniform(*ELEVATION), rng.uniform(0, 2 * np.pi)
    focal = rng.uniform(*FOCAL) * width
    away = np.array(
        [np.cos(elevation) * np.cos(around), np.cos(elevation) * np.sin(around), np.sin(elevation)]
    )
    distance = 1.5 * max(float(np.linalg.norm(high - low)), 0.05)
    for _ in range(STEPS):
        camera = look_at(target + distance * away, target, focal, width, height)
        pixels, depth = camera.project(points)
        if depth.min() < 0.05 * distance:
            distance *= 1.5
            continue
        middle = (pixels.min(axis=0) + pixels.max(axis=0)) / 2
        filled = float((np.ptp(pixels, axis=0) / [width, height]).max())
        target = camera.unproject(middle, np.array(float(np.linalg.norm(camera.position - target))))
        distance *= max(filled / FILLED, 0.3)
    return look_at(target + distance * away, target, focal, width, height)
