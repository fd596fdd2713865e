"""Colours of Gaussians from the keyframe: seen ones from their pixel, hidden ones from the nearest seen."""

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8
from scipy import ndimage
from scipy.spatial import cKDTree

from model.reconstruction.fill import Filling
from model.reconstruction.volume import mask_distance, sample_image
from model.types import Array, Camera


def colors_from_image(
    filling: Filling, camera: Camera, image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]
) -> Float64[Array, "G 3"]:
    """RGB (0..1) of every Gaussian.

    Hidden Gaussians take the colour of the nearest seen one, with the distance along the viewing
    direction counting little: the far side mirrors the near side.
    """
    seen = visible(filling, camera)
    picture = without_rim(image, mask)
    pixels, _ = camera.project(filling.means)
    colors = np.stack([sample_image(picture[..., i], pixels) for i in range(3)], axis=-1) / 255.0
    view = filling.means.mean(0) - camera.position
    view = view / np.linalg.norm(view)
    flattened = filling.means - 0.75 * (filling.means @ view)[:, None] * view
    _, nearest = cKDTree(flattened[seen]).query(flattened[~seen])
    colors[~seen] = colors[seen][nearest]
    return colors


def visible(filling: Filling, camera: Camera) -> Bool[Array, " G"]:
    """Surface Gaussians that face the camera and that no other one hides."""
    pixels, depth = camera.project(filling.means)
    away = filling.means - camera.position
    facing = filling.surface & (np.einsum("gi,gi->g", filling.normals, away) < 0)
    pixel = float(np.median(depth)) / float(camera.intrinsics[0, 0])
    reach = max(round(0.6 * filling.spacing / max(pixel, 1e-9)), 0)
    nearest = nearest_depth(pixels, depth, camera, reach)
    # Within its window a slanted surface has some depth of its own.
    tolerance = max(1.5 * filling.spacing, 2.0 * (reach + 0.5) * pixel)
    corner = np.round(pixels).astype(int)
    inside = (corner >= 0).all(-1) & (corner[:, 0] < camera.width) & (corner[:, 1] < camera.height)
    corner = np.clip(corner, 0, [camera.width - 1, camera.height - 1])
    seen = facing & inside & (depth > 0) & (depth < nearest[corner[:, 1], corner[:, 0]] + tolerance)
    if not seen.any():
        seen = inside & (depth <= np.quantile(depth, 0.5))
    return seen if seen.any() else np.ones(len(depth), bool)


def nearest_depth(
    pixels: Float64[Array, "G 2"], depth: Float64[Array, " G"], camera: Camera, reach: int
) -> Float64[Array, "H W"]:
    """Depth [m] of the nearest point within `reach` pixels of every pixel; infinite where there is none."""
    nearest = np.full((camera.height, camera.width), np.inf)
    corner = np.round(pixels).astype(int)
    inside = (
        (corner >= 0).all(-1) & (corner[:, 0] < camera.width) & (corner[:, 1] < camera.height) & (depth > 0)
    )
    np.minimum.at(nearest, (corner[inside, 1], corner[inside, 0]), depth[inside])
    dense: Float64[Array, "H W"] = ndimage.minimum_filter(nearest, size=2 * reach + 1)
    return dense


def without_rim(image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]) -> Float32[Array, "H W 3"]:
    """The image with the mask's rim and surroundings replaced by the nearest colour well inside.

    Pixels on the outline mix object and background; a thin object keeps at least its middle.
    """
    distance = mask_distance(mask)
    inner = distance > min(2.0, 0.5 * float(distance.max()))
    index = ndimage.distance_transform_edt(~inner, return_distances=False, return_indices=True)
    picture: Float32[Array, "H W 3"] = image[index[0], index[1]].astype(np.float32)
    return picture
