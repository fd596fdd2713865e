"""Image features → features on Gaussians, the invisible side completed."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int
from scipy.spatial import cKDTree

from model.errors import InputError
from model.symmetry import find_reflections
from model.types import Array, Camera, Features, Gaussians

MAX_DIM = 32
NEIGHBOUR_COUNT = 6
COUNTERPART_TOLERANCE = 1.5
"""How far a mirror image may be from its counterpart, in spacings of the Gaussians."""
DEPTH_TOLERANCE = 1.6
"""How far behind the front-most disc a Gaussian still belongs to the surface, in its own radius."""
BUFFER_RADIUS = 3.0
"""Median radius of a disc in the z-buffer [px]: larger images are tested at a lower resolution."""
MAX_BUFFER_RADIUS = 24
FEW_SEEN = 0.02


def lift_features(
    feature_map: Float32[Array, "h w D"],
    gaussians: Gaussians,
    camera: Camera,
    object_mask: Bool[Array, "H W"],
) -> Features:
    """Give every Gaussian a feature.

    Gaussians that the camera sees sample the feature map at their projection (cells outside the mask do
    not bleed in), and principal components of those samples are kept. A Gaussian that is not seen takes
    the feature of its mirror image if the object has a reflection plane and that image was seen, else the
    distance-weighted mean of its nearest seen Gaussians in space.

    Args:
        feature_map: From a semantic encoder, over the whole image.
        gaussians: The object.
        camera: The one that took the image.
        object_mask: Where the object is seen.

    Raises:
        InputError: no Gaussian is seen inside the mask.
    """
    seen = visible_gaussians(gaussians, camera, object_mask)
    if not seen.any():
        raise InputError("no Gaussian of the object is seen inside its mask: check the camera and the mask")
    pixels, _ = camera.project(gaussians.means[seen])
    components = _principal_components(_sample(feature_map, pixels, object_mask))

    values = np.zeros((len(gaussians), components.shape[1]), np.float32)
    values[seen] = components
    origin = np.full(len(gaussians), Features.NEIGHBOURHOOD)
    origin[seen] = Features.SEEN
    counterpart = _counterparts(gaussians, seen, camera)
    mirrored = counterpart >= 0
    values[mirrored] = values[counterpart[mirrored]]
    origin[mirrored] = Features.SYMMETRY
    rest = origin == Features.NEIGHBOURHOOD
    values[rest] = _from_neighbours(gaussians.means[rest], gaussians.means[seen], components)

    share = float(seen.mean())
    warnings = (f"only {share:.1%} of the Gaussians are seen on the keyframe",) if share < FEW_SEEN else ()
    return Features(values=values, origin=origin, warnings=warnings)


def visible_gaussians(
    gaussians: Gaussians, camera: Camera, object_mask: Bool[Array, "H W"]
) -> Bool[Array, " G"]:
    """Which Gaussians lie on the surface that the camera sees, inside the mask.

    All Gaussians are splatted into a z-buffer as discs that face the camera, at their projected size; one is
    visible if it is in front of the camera, its centre projects inside the mask, and it is no further behind
    the front-most disc there than a tolerance relative to its own size.

    Args:
        gaussians: The object.
        camera: Where it is seen from.
        object_mask: Pixels where nothing else (the hand) hides the object, at the camera's resolution.

    Raises:
        InputError: the mask and the camera disagree on the size of the image.
    """
    height, width = object_mask.shape
    if (height, width) != (camera.height, camera.width):
        raise InputError(
            f"object mask is {width}x{height} but the camera's image is {camera.width}x{camera.height}: "
            "give a mask of the image's size"
        )
    pixels, depth = camera.project(gaussians.means)
    radius = disc_radii(gaussians)
    in_front = depth > 1e-6
    focal = float(np.sqrt(camera.intrinsics[0, 0] * camera.intrinsics[1, 1]))
    projected = np.where(in_front, focal * radius / np.where(in_front, depth, 1.0), 0.0)

    column, row = np.round(np.clip(pixels, -1.0, [width, height])).astype(np.int64).T
    inside = in_front & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    inside[inside] = object_mask[row[inside], column[inside]]
    front = _front_depth(pixels, depth, projected, in_front, (height, width))
    visible: Bool[Array, " G"] = inside & (depth <= front + DEPTH_TOLERANCE * radius)
    return visible


def disc_radii(gaussians: Gaussians) -> Float64[Array, " G"]:
    """Radius of the disc that stands for each Gaussian [m].

    The geometric mean of its standard deviations, but at least three quarters of the distance to its fourth
    neighbour: the discs of a surface must close it, however small the Gaussians were made.
    """
    size: Float64[Array, " G"] = np.exp(np.log(gaussians.scales.astype(np.float64)).mean(axis=1))
    if len(gaussians) > 4:
        size = np.maximum(size, 0.75 * _neighbour_distance(gaussians.means))
    return size


def _neighbour_distance(points: Float[Array, "N 3"]) -> Float64[Array, " N"]:
    """Distance to the fourth neighbour [m]: the spacing on a surface and within a volume alike."""
    distance, _ = cKDTree(points).query(points, k=5)
    fourth: Float64[Array, " N"] = distance[:, 4]
    return fourth


def _front_depth(
    pixels: Float64[Array, "G 2"],
    depth: Float64[Array, " G"],
    radius: Float64[Array, " G"],
    drawn: Bool[Array, " G"],
    size: tuple[int, int],
) -> Float64[Array, " G"]:
    """Depth of the front-most disc at each centre [m]; infinite outside the image.

    Args:
        pixels: Centres [px].
        depth: Along the optical axis [m].
        radius: Of the discs in the image [px].
        drawn: Which discs take part.
        size: Height and width of the image [px].
    """
    median = float(np.median(radius[drawn])) if drawn.any() else 1.0
    scale = min(1.0, BUFFER_RADIUS / max(median, 1e-9))
    height, width = (int(np.ceil(side * scale)) for side in size)
    margin = MAX_BUFFER_RADIUS
    limit = [width + 2.0 * margin - 1.0, height + 2.0 * margin - 1.0]
    centre = np.clip(np.floor((pixels + 0.5) * scale) + margin, 0.0, limit).astype(np.int64)
    whole = np.clip(np.round(radius * scale), 0, MAX_BUFFER_RADIUS).astype(np.int64)

    buffer = np.full((height + 4 * margin, width + 4 * margin), np.inf)
    stride = buffer.shape[1]
    flat = (centre[:, 1] + margin) * stride + centre[:, 0] + margin
    for each in np.unique(whole[drawn]):
        chosen = drawn & (whole == each)
        dy, dx = np.nonzero(_disc(int(each)))
        offsets = (dy - each) * stride + (dx - each)
        covered = flat[chosen][:, None] + offsets
        np.minimum.at(buffer.reshape(-1), covered.ravel(), np.repeat(depth[chosen], len(offsets)))
    front: Float64[Array, " G"] = buffer.reshape(-1)[flat]
    return front


def _disc(radius: int) -> Bool[Array, "s s"]:
    """Pixels within `radius` of the middle one."""
    axis = np.arange(-radius, radius + 1)
    inside: Bool[Array, "s s"] = axis[:, None] ** 2 + axis**2 <= (radius + 0.3) ** 2
    return inside


def _sample(
    feature_map: Float32[Array, "h w D"], pixels: Float64[Array, "n 2"], object_mask: Bool[Array, "H W"]
) -> Float32[Array, "n D"]:
    """Bilinear samples in which each cell counts by its share of object pixels."""
    rows, columns, dim = feature_map.shape
    height, width = object_mask.shape
    share = cv2.resize(object_mask.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    # Every sample lies inside the mask, but the four cells around it may hold none of the object.
    weight = share.reshape(-1) + np.float32(1e-4)
    x = np.clip((pixels[:, 0] + 0.5) * columns / width - 0.5, 0.0, columns - 1.0)
    y = np.clip((pixels[:, 1] + 0.5) * rows / height - 0.5, 0.0, rows - 1.0)
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    flat = feature_map.reshape(-1, dim)
    total = np.zeros((len(pixels), dim), np.float32)
    norm = np.zeros((len(pixels), 1), np.float32)
    for dy in (0, 1):
        for dx in (0, 1):
            cell = np.minimum(top + dy, rows - 1) * columns + np.minimum(left + dx, columns - 1)
            near = np.abs(1 - dx - (x - left)) * np.abs(1 - dy - (y - top))
            each = (near.astype(np.float32) * weight[cell])[:, None]
            total += each * flat[cell]
            norm += each
    return total / norm


def _principal_components(samples: Float32[Array, "n D"]) -> Float32[Array, "n d"]:
    """Coordinates along at most 32 principal directions, signed so that their largest entry is positive."""
    centred = samples.astype(np.float64) - samples.mean(axis=0, dtype=np.float64)
    _, directions = np.linalg.eigh(centred.T @ centred)
    kept = directions[:, ::-1][:, :MAX_DIM]
    largest = np.abs(kept).argmax(axis=0)
    kept = kept * np.where(kept[largest, np.arange(kept.shape[1])] < 0.0, -1.0, 1.0)
    coordinates: Float32[Array, "n d"] = (centred @ kept).astype(np.float32)
    return coordinates


def _counterparts(gaussians: Gaussians, seen: Bool[Array, " G"], camera: Camera) -> Int[Array, " G"]:
    """For every unseen Gaussian, the seen one nearest to its mirror image; -1 where there is none.

    The viewing direction is among the candidates: what is inflated from a silhouette mirrors at its
    mid-surface. The better plane is asked first.
    """
    counterpart = np.full(len(gaussians), -1)
    if len(gaussians) <= 4 or seen.all():
        return counterpart
    points = gaussians.means.astype(np.float64)
    tolerance = COUNTERPART_TOLERANCE * float(np.median(_neighbour_distance(points)))
    visible = np.flatnonzero(seen)
    tree = cKDTree(points[visible])
    for reflection in find_reflections(points, tolerance, directions=(camera.forward,)):
        missing = np.flatnonzero(~seen & (counterpart < 0))
        distance, nearest = tree.query(reflection(points[missing]), distance_upper_bound=tolerance)
        found = np.isfinite(distance)
        counterpart[missing[found]] = visible[nearest[found]]
    return counterpart


def _from_neighbours(
    points: Float32[Array, "n 3"], known_points: Float32[Array, "m 3"], known: Float32[Array, "m D"]
) -> Float32[Array, "n D"]:
    """Inverse-square-distance means of the nearest known values."""
    count = min(NEIGHBOUR_COUNT, len(known))
    distance, index = cKDTree(known_points).query(points, k=np.arange(1, count + 1))
    weight = 1.0 / (distance**2 + 1e-12)
    weight /= weight.sum(axis=1, keepdims=True)
    values: Float32[Array, "n D"] = np.einsum("nk,nkd->nd", weight, known[index]).astype(np.float32)
    return values
