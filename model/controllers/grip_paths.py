"""Where a grip may have gone in depth, which one view does not show: a few paths that look the same."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from model.types import Array, Calibration, Controllers

STEEPEST = 0.15
"""Least cosine between a ray and the normal of a plane it is cut with: beyond, a pixel is metres."""
FARTHEST = 3.0
"""How much farther than the constant-depth path any other may go."""


def grip_paths(controllers: Controllers, calibration: Calibration) -> dict[str, Controllers]:
    """Paths through the same pixels as `controllers`, which moves parallel to the image.

    `parallel` is the given one. `upright` moves in the vertical plane through the rest place that faces the
    camera, as a straight lift does; `between` goes halfway. `sliding` keeps the height of the rest place, as
    a push along the table does. A place that would sink below its rest height stays on the given path, and a
    path that would leave the scene is not offered.

    Args:
        controllers: The motion from the keyframe on; each group moves as a whole.
        calibration: The camera that sees it; its z is up.
    """
    forward = calibration.camera.forward * np.array([1.0, 1.0, 0.0])
    paths = {"parallel": controllers}
    if not len(controllers.group) or np.linalg.norm(forward) < 1e-6:
        return paths
    facing = forward / np.linalg.norm(forward)
    offers = {"upright": (facing, 1.0), "between": (facing, 0.5)}
    if calibration.ground_height is not None:
        offers["sliding"] = (np.array([0.0, 0.0, 1.0]), 1.0)
    for name, (normal, share) in offers.items():
        moved = _moved_onto(controllers, calibration, normal, share)
        if moved is not None:
            paths[name] = moved
    return paths


def _moved_onto(
    controllers: Controllers, calibration: Calibration, normal: Float64[Array, " 3"], share: float
) -> Controllers | None:
    """Each group shifted along its rays, by `share` of the way to the plane through its rest place."""
    motion = controllers.motion.astype(np.float64)
    eye = calibration.camera.position
    for group in np.unique(controllers.group):
        members = controllers.group == group
        path = motion[:, members].mean(axis=1)
        rays = path - eye
        across = rays @ normal
        reach = float((path[0] - eye) @ normal)
        if np.any(np.abs(across) < STEEPEST * np.linalg.norm(rays, axis=1)) or np.any(across * reach <= 0):
            return None
        onto = eye + rays * (reach / across)[:, None]
        target = path + share * (onto - path)
        farther = np.linalg.norm(target - path[0], axis=1) > FARTHEST * (
            np.linalg.norm(path - path[0], axis=1).max() + 0.01
        )
        if farther.any():
            return None
        if calibration.ground_height is not None:
            sunk = target[:, 2] < path[0, 2] - 1e-4
            target[sunk] = path[sunk]
        motion[:, members] += (target - path)[:, None]
    return replace(controllers, motion=motion.astype(np.float32))
