"""A small ray-traced world: ellipsoids over a table, with the camera that really saw them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from model.types import Calibration, Camera, Frames, Masks

WIDTH, HEIGHT = 200, 150


@dataclass(frozen=True)
class Scene:
    frames: Frames
    masks: Masks
    camera: Camera
    depth: np.ndarray
    """Of the keyframe [m]."""

    @property
    def image(self) -> np.ndarray:
        return self.frames.images[self.masks.keyframe]

    @property
    def mask(self) -> np.ndarray:
        return self.masks.object[self.masks.keyframe]

    def calibration(self, ground: float | None = 0.0) -> Calibration:
        return Calibration(self.camera, (0.0, 0.0, -9.81), ground, "", "", "")


def looking_down(pitch: float, distance: float, fov: float = 60.0) -> Camera:
    """A camera that sees the world's origin in its middle, `pitch` degrees from above the horizon."""
    angle = np.deg2rad(pitch)
    forward = np.array([0.0, np.cos(angle), -np.sin(angle)])
    right = np.array([1.0, 0.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = -distance * forward
    focal = 0.5 * WIDTH / np.tan(0.5 * np.deg2rad(fov))
    intrinsics = np.array([[focal, 0, 0.5 * (WIDTH - 1)], [0, focal, 0.5 * (HEIGHT - 1)], [0, 0, 1.0]])
    return Camera(intrinsics, pose, WIDTH, HEIGHT)


def ellipsoid_depth(camera: Camera, rays: np.ndarray, center: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Depth along the optical axis of the first hit, infinite where there is none."""
    start = (camera.position - np.asarray(center)) / radii
    direction = rays / radii
    a, b, c = (direction**2).sum(-1), direction @ start, start @ start - 1.0
    root = b**2 - a * c
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)


@pytest.fixture(scope="session")
def scene_of() -> Callable[..., Scene]:
    """Make a scene of ellipsoids (center, radii) [m], on a table or in front of changing clutter."""

    def make(
        bodies: list[tuple[tuple[float, float, float], tuple[float, float, float]]],
        pitch: float = 50.0,
        distance: float = 0.6,
        fov: float = 60.0,
        table: bool = True,
    ) -> Scene:
        camera = looking_down(pitch, distance, fov)
        pixels = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), -1).reshape(-1, 2).astype(float)
        rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
        hits = np.stack([ellipsoid_depth(camera, rays, *map(np.array, body)) for body in bodies])
        body_depth = hits.min(axis=0)
        ground_depth = np.where(rays[:, 2] < 0, -camera.position[2] / np.minimum(rays[:, 2], -1e-9), np.inf)
        background = ground_depth if table else np.full(len(rays), 3.0)
        mask = np.isfinite(body_depth) & (body_depth < background)
        depth = np.where(mask, body_depth, np.where(np.isfinite(background), background, 0.0))
        points = camera.unproject(pixels, np.where(mask, body_depth, 1.0))
        colors = np.full((len(rays), 3), 205.0)
        colors[mask] = [180, 60, 40]
        colors[mask & (points[:, 0] > 0)] = [40, 70, 180]  # red on the left, blue on the right
        mask, depth = mask.reshape(HEIGHT, WIDTH), depth.reshape(HEIGHT, WIDTH)
        images = np.repeat(colors.reshape(1, HEIGHT, WIDTH, 3), 4, axis=0)
        if not table:
            blocks = np.random.default_rng(0).uniform(0, 255, (4, HEIGHT // 10, WIDTH // 10, 3))
            clutter = np.kron(blocks, np.ones((1, 10, 10, 1)))
            images = np.where(mask[None, ..., None], images, clutter)
        frames = Frames(images.astype(np.uint8), np.arange(4) / 30.0, "scene", "0" * 64)
        objects = np.repeat(mask[None], 4, axis=0)
        return Scene(frames, Masks(objects, np.zeros_like(objects), 0), camera, depth)

    return make


@pytest.fixture
def strand(scene_of: Callable[..., Scene]) -> Scene:
    """A straight rope of 24 cm with a radius of 1.2 cm on a table."""
    return scene_of([((x, 0.0, 0.012), (0.012, 0.012, 0.012)) for x in np.linspace(-0.108, 0.108, 80)])


@pytest.fixture
def teddy(scene_of: Callable[..., Scene]) -> Scene:
    """A lying body with head and four limbs, a good 20 cm long."""
    limbs = [((s * 0.055, y, 0.02), (0.035, 0.02, 0.02)) for s in (-1, 1) for y in (-0.04, 0.035)]
    return scene_of([((0, 0, 0.04), (0.04, 0.055, 0.04)), ((0, 0.085, 0.035), (0.035, 0.035, 0.035)), *limbs])
