"""The plane an object lies on, fitted to depth around it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy import ndimage

from model.types import Array

TRIALS = 300
MINIMUM_SHARE = 0.5
"""Of the surroundings that must lie on the plane."""
LEVEL = float(np.sin(np.deg2rad(15.0)))
"""A plane that faces up by more than this, as the picture has it, may be a ground whatever lies on it."""
NEARBY = 0.6
"""One that does not, as seen from straight above, or a wall, is a ground where the object comes so near it,
over the longest side of what is seen of it."""


@dataclass(frozen=True)
class GroundPlane:
    """A plane in camera coordinates, seen from above."""

    up: Float64[Array, " 3"]
    """Unit normal towards the camera."""
    camera_height: float
    """Of the optical centre over the plane [m]."""
    inliers: float
    """Share of the surroundings within `tolerance`."""
    tolerance: float
    """[m]."""


def back_projected(
    depth: Float[Array, "H W"], intrinsics: Float64[Array, "3 3"], where: Bool[Array, "H W"]
) -> Float64[Array, "N 3"]:
    """Camera coordinates [m] of the pixels in `where`, given depth [m]."""
    rows, columns = np.nonzero(where)
    z = np.asarray(depth, np.float64)[rows, columns]
    homogeneous = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(intrinsics).T
    points: Float64[Array, "N 3"] = homogeneous * z[:, None]
    return points


def ground_from_depth(
    depth: Float[Array, "H W"],
    intrinsics: Float64[Array, "3 3"],
    object_mask: Bool[Array, "H W"],
    hand: Bool[Array, "H W"],
) -> GroundPlane | None:
    """The dominant plane of the object's surroundings, or None where there is none below it.

    Args:
        depth: Depth [m], 0 or NaN = missing.
        intrinsics: K [px].
        object_mask: The object.
        hand: The hand, which is no ground.

    Reference:
        Fischler and Bolles (1981), Random sample consensus.
    """
    reach = max(8.0, 0.6 * float(np.sqrt(np.count_nonzero(object_mask))))
    distance = ndimage.distance_transform_edt(~object_mask)
    measured = np.isfinite(depth) & (depth > 0)
    ring = (distance > 4) & (distance < reach) & ~ndimage.binary_dilation(hand, iterations=4) & measured
    points = back_projected(depth, intrinsics, ring)
    if len(points) < 100:
        return None
    rng = np.random.default_rng(0)
    points = points[rng.choice(len(points), min(len(points), 4000), replace=False)]
    tolerance = 0.003 + 0.004 * float(np.median(points[:, 2])) ** 2  # stereo noise grows with z²
    normal, offset = _consensus(points, tolerance, rng)
    inside = np.abs(points @ normal - offset) < tolerance
    share = float(inside.mean())
    if share < MINIMUM_SHARE:
        return None
    centre = points[inside].mean(0)
    normal = np.linalg.svd(points[inside] - centre, full_matrices=False)[2][2]
    offset = float(normal @ centre)
    if offset > 0:  # the camera (origin) lies on the upper side: normal·0 − offset > 0
        normal, offset = -normal, -offset
    if normal[1] > 0.5:  # a ceiling, not a ground
        return None
    if normal[1] > -LEVEL:  # a wall behind it, or a ground from above
        seen = back_projected(depth, intrinsics, object_mask & measured)
        if not _lies_on(seen, normal, offset):
            return None
    return GroundPlane(normal, -offset, share, tolerance)


def _lies_on(seen: Float64[Array, "N 3"], normal: Float64[Array, " 3"], offset: float) -> bool:
    """Whether what is seen of the object comes near the plane: of a ball from above it is the upper half."""
    if len(seen) == 0:
        return False
    height = seen @ normal - offset
    return float(np.percentile(height, 5)) < NEARBY * float(np.ptp(seen, axis=0).max())


def _consensus(
    points: Float64[Array, "N 3"], tolerance: float, rng: np.random.Generator
) -> tuple[Float64[Array, " 3"], float]:
    """The plane through three points that most points lie on: normal and offset."""
    triples = points[rng.integers(0, len(points), (TRIALS, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    length = np.linalg.norm(normals, axis=-1)
    normals, triples = normals[length > 1e-12], triples[length > 1e-12]
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    offsets = np.einsum("ti,ti->t", normals, triples[:, 0])
    counts = (np.abs(points @ normals.T - offsets) < tolerance).sum(axis=0)
    best = int(counts.argmax())
    return normals[best], float(offsets[best])
