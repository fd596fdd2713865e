"""What cameras see of an object: the side that faces one of them in the first frame."""

from dataclasses import replace

import numpy as np

from benchmarks.reality.hands import rotation
from benchmarks.reality.shapes import Inside
from benchmarks.reality.world import Array, Motion, Scene

APART = (np.deg2rad(60), np.deg2rad(120))
"""About the vertical through the object, between two cameras."""
STEP, LIFTED = 0.003, 0.002
"""Of a ray from the surface to a camera, and how far above the surface it begins [m]."""


def cameras(first: tuple[float, float, float], scene: Scene, rng: np.random.Generator) -> Array:
    """Where one or two cameras stand [c, 3] m; the first one stands `first` from where the object lies."""
    turned = rotation(np.array([0, 0, rng.uniform(*APART) * rng.choice([-1, 1])])) @ np.asarray(first)
    count = int(rng.integers(1, 3))
    return np.stack([np.asarray(first), turned])[:count] + scene.shift * [1, 1, 0]


def facing_of_line(skin: Array, line: Array, eyes: Array) -> Array:
    """Which points [N, 3] on the skin of a rope face one of the eyes [c, 3]; its middle is `line` [n, 3]."""
    nearest = np.linalg.norm(skin[:, None] - line, axis=2).argmin(axis=1)
    outward = skin - line[nearest]
    return np.asarray(((eyes[:, None] - skin) * outward).sum(axis=2).max(axis=0) > 0)


def facing_of_volume(surface: Array, inside: Inside, scene: Scene, eyes: Array) -> Array:
    """From which points [N, 3] of the surface of a solid at rest no part of it is before one of the eyes.

    Args:
        surface: As the solid rests before it is put into the scene.
        inside: Which places are within it.
        scene: How it is turned and shifted into the first frame.
        eyes: Where cameras stand in the scene [c, 3].
    """
    resting = (eyes - scene.shift) @ scene.turn
    far = float(np.linalg.norm(np.ptp(surface, axis=0)))
    along = np.arange(LIFTED, far + STEP, STEP)
    free = np.zeros(len(surface), bool)
    for eye in resting:
        ray = eye - surface
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        places = surface[:, None] + along[:, None] * ray[:, None]
        blocked = inside(places.reshape(-1, 3)).reshape(places.shape[:2]).any(axis=1)
        free |= ~blocked
    return free


def kept(motion: Motion, which: Array) -> Motion:
    """The motion of these points [N] alone."""
    acts = {name: share[which] for name, share in motion.acts.items()}
    return replace(motion, points=motion.points[:, which], acts=acts)
