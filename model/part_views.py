"""Parts on Gaussians → what a material expert sees of each part on the keyframe."""

import numpy as np
from jaxtyping import Bool, UInt8
from scipy.spatial import cKDTree

from model.types import Array, Camera, Gaussians, Parts, PartView, ShapeClass


def view_parts(
    image: UInt8[Array, "H W 3"],
    object_mask: Bool[Array, "H W"],
    gaussians: Gaussians,
    parts: Parts,
    visible: Bool[Array, " G"],
    camera: Camera,
    shape_class: ShapeClass | None = None,
) -> list[PartView]:
    """Give every object pixel to the part of the nearest visible Gaussian.

    Args:
        image: The keyframe.
        object_mask: Object pixels on the keyframe.
        gaussians: The reconstruction.
        parts: Its partition.
        visible: Which Gaussians the camera sees.
        camera: Of the keyframe.
        shape_class: Of the whole, if it is known.

    Returns:
        One view per part, in the order of the labels. A part that is wholly hidden gets an empty mask.
    """
    rows, columns = np.nonzero(object_mask)
    owner = np.full(len(rows), -1)
    if visible.any() and len(rows):
        pixels, _ = camera.project(gaussians.means[visible])
        _, nearest = cKDTree(pixels).query(np.stack([columns, rows], axis=1))
        owner = parts.labels[visible][nearest]
    views = []
    for part in range(parts.count):
        mask = np.zeros_like(object_mask)
        chosen = owner == part
        mask[rows[chosen], columns[chosen]] = True
        views.append(PartView(image, mask, object_mask, f"part {part}", shape_class))
    return views
