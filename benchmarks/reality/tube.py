"""What cameras see of a rope: not its middle line, but places on its skin."""

from dataclasses import replace

import numpy as np

from benchmarks.reality.world import Array, Motion

AROUND = 3
"""Places on the skin for each of those on the middle line."""


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

    From each tangent to the next they are reflected twice.

    Reference:
        Wang, Jüttler, Zheng, Liu (2008), Computation of rotation minimizing frames, ACM Transactions on
        Graphics 27 (double reflection).
    """
    tangent = np.gradient(line, axis=1)
    tangent /= np.linalg.norm(tangent, axis=2, keepdims=True)
    normal = np.empty_like(line)
    start = np.eye(3)[np.abs(tangent[0, 0]).argmin()]
    normal[0, 0] = _perpendicular(start, tangent[0, 0])
    for frame in range(1, len(line)):
        normal[frame, 0] = _carried(normal[frame - 1, 0], tangent[frame - 1, 0], tangent[frame, 0])
    for i in range(1, line.shape[1]):
        normal[:, i] = _carried(
            normal[:, i - 1], tangent[:, i - 1], tangent[:, i], line[:, i] - line[:, i - 1]
        )
    return normal, np.cross(tangent, normal)


def _carried(normal: Array, before: Array, after: Array, way: Array | None = None) -> Array:
    """A normal [..., 3] of one tangent as one of the next, reflected across the way between them first."""
    if way is not None:
        normal, before = _reflected(normal, way), _reflected(before, way)
    return _perpendicular(_reflected(normal, after - before), after)


def _reflected(vector: Array, across: Array) -> Array:
    square = np.maximum((across**2).sum(-1, keepdims=True), 1e-30)
    return np.asarray(vector - 2.0 * (vector * across).sum(-1, keepdims=True) / square * across)


def _perpendicular(vector: Array, tangent: Array) -> Array:
    vector = vector - (vector * tangent).sum(-1, keepdims=True) * tangent
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))
