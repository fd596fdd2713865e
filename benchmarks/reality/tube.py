"""What cameras see of a rope: not its middle line, but places on its skin."""

from dataclasses import replace

import numpy as np

from benchmarks.reality.world import Array, Motion

AROUND = 3
"""Places on the skin for each of those on the middle line."""
OVER = 0.015
"""Before and behind a point, over which it is told how the line runs there [m]."""


def on_skin(motion: Motion, radius: float, rng: np.random.Generator) -> Motion:
    """The motion of places on the skin of a rope whose middle line moved like that, which does not twist.

    Args:
        motion: Of points on the middle line, in their order along it.
        radius: Of the rope [m].
        rng: Where on the skin they are; of the same state, they are the same places.
    """
    which = rng.permutation(np.repeat(np.arange(motion.points.shape[1]), AROUND))
    angle = rng.uniform(0, 2 * np.pi, len(which))
    up, side = (each[:, which] for each in untwisted(motion.points))
    beside = np.cos(angle)[:, None] * up + np.sin(angle)[:, None] * side
    acts = {name: share[which] for name, share in motion.acts.items()}
    return replace(motion, points=motion.points[:, which] + radius * beside, acts=acts)


def untwisted(line: Array) -> tuple[Array, Array]:
    """Two unit normals [T, N, 3] of a line [T, N, 3], carried along it, and in time at its first point.

    From each tangent to the next they turn by as much as they must.

    Reference:
        Bishop (1975), There is more than one way to frame a curve, American mathematical monthly 82.
    """
    tangent = tangents(line)
    normal = np.empty_like(line)
    normal[0, 0] = _perpendicular(np.eye(3)[np.abs(tangent[0, 0]).argmin()], tangent[0, 0])
    for frame in range(1, len(line)):
        normal[frame, 0] = _perpendicular(normal[frame - 1, 0], tangent[frame, 0])
    for i in range(1, line.shape[1]):
        normal[:, i] = _perpendicular(normal[:, i - 1], tangent[:, i])
    return normal, np.cross(tangent, normal)


def tangents(line: Array) -> Array:
    """Directions of a line [T, N, 3], told over a little way: points side by side tell none."""
    arc = np.concatenate([[0.0], np.linalg.norm(np.diff(line[0], axis=0), axis=1).cumsum()])
    last = len(arc) - 1
    behind = np.clip(np.searchsorted(arc, arc - OVER, side="right") - 1, 0, last)
    ahead = np.clip(np.searchsorted(arc, arc + OVER), 0, last)
    way = line[:, ahead] - line[:, behind]
    return np.asarray(way / np.linalg.norm(way, axis=2, keepdims=True))


def _perpendicular(vector: Array, tangent: Array) -> Array:
    vector = vector - (vector * tangent).sum(-1, keepdims=True) * tangent
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))
