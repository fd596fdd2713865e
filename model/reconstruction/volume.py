"""A body as a signed-distance grid: what every reconstruction method fills with Gaussians."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64
from scipy import ndimage
from scipy.spatial import cKDTree

from model.types import Array, Camera

VOXEL_BUDGET = 500_000


@dataclass(frozen=True)
class Volume:
    """Signed distance to the surface of a body on a regular grid, positive inside."""

    distance: Float32[Array, "X Y Z"]
    """[m]; accurate near the surface, elsewhere only its sign matters."""
    origin: Float64[Array, " 3"]
    """World position of the centre of voxel (0, 0, 0) [m]."""
    axes: Float64[Array, "3 3"]
    """Columns are the grid's unit axes in the world."""
    spacing: float
    """Voxel edge [m]."""

    @property
    def points(self) -> Float64[Array, "X Y Z 3"]:
        """Centres of all voxels in the world [m]."""
        return grid_points(self.distance.shape, self.origin, self.axes, self.spacing)

    @property
    def occupancy(self) -> Float32[Array, "X Y Z"]:
        """Share of each voxel that lies inside, 0..1."""
        return np.clip(self.distance / self.spacing + 0.5, 0.0, 1.0).astype(np.float32)

    @property
    def total(self) -> float:
        """Volume of the body [m³]."""
        return float(self.occupancy.sum(dtype=np.float64) * self.spacing**3)

    def sample(self, points: Float[Array, "N 3"]) -> Float64[Array, " N"]:
        """Signed distance [m] at world points [m], trilinear; outside the grid far outside the body."""
        return self._interpolate(self.distance, points, -10.0 * self.spacing)

    def gradient(self, points: Float[Array, "N 3"]) -> Float64[Array, "N 3"]:
        """World gradient of the signed distance: points inwards, about unit length at the surface."""
        step = self.spacing
        slopes = [
            (self.sample(points + step * axis) - self.sample(points - step * axis)) / (2.0 * step)
            for axis in self.axes.T
        ]
        gradient: Float64[Array, "N 3"] = np.stack(slopes, axis=-1) @ self.axes.T
        return gradient

    def _interpolate(
        self, values: Float[Array, "X Y Z"], points: Float[Array, "N 3"], outside: float
    ) -> Float64[Array, " N"]:
        index = (np.asarray(points, np.float64) - self.origin) @ self.axes / self.spacing
        sampled: Float64[Array, " N"] = ndimage.map_coordinates(
            values, index.T, order=1, mode="constant", cval=outside, output=np.float64
        )
        return sampled


def grid_points(
    shape: tuple[int, ...], origin: Float64[Array, " 3"], axes: Float64[Array, "3 3"], spacing: float
) -> Float64[Array, "X Y Z 3"]:
    """Centres of the voxels of a grid in the world [m]."""
    index = np.stack(np.meshgrid(*(np.arange(count) for count in shape), indexing="ij"), axis=-1)
    points: Float64[Array, "X Y Z 3"] = origin + (index * spacing) @ axes.T
    return points


def grid_around(
    low: Float[Array, " 3"], high: Float[Array, " 3"], axes: Float64[Array, "3 3"], finest: float
) -> tuple[tuple[int, int, int], Float64[Array, " 3"], float]:
    """Shape, origin [m] and spacing [m] of a grid over a box given in grid axes.

    Args:
        low: Lowest corner along the grid axes [m].
        high: Highest corner along the grid axes [m].
        axes: Columns are the grid axes in the world.
        finest: No finer spacing than this [m] is worth having.
    """
    size = np.maximum(np.asarray(high) - low, finest)
    spacing = max(float((np.prod(size) / VOXEL_BUDGET) ** (1.0 / 3.0)), finest, float(size.max()) / 400.0)
    low = np.asarray(low) - 3.0 * spacing
    counts = np.ceil((np.asarray(high) + 3.0 * spacing - low) / spacing).astype(int) + 1
    return (int(counts[0]), int(counts[1]), int(counts[2])), axes @ low, spacing


def without_specks(volume: Volume) -> Volume:
    """The body without detached pieces of less than a fiftieth of its largest piece."""
    label, count = ndimage.label(volume.distance > 0)
    if count < 2:
        return volume
    sizes = np.bincount(label.ravel())
    sizes[0] = 0
    speck = (sizes < 0.02 * sizes.max())[label] & (label > 0)
    distance = np.where(speck, np.float32(-volume.spacing), volume.distance)
    return Volume(distance, volume.origin, volume.axes, volume.spacing)


def distance_to_samples(
    points: Float64[Array, "N 3"],
    normals: Float64[Array, "N 3"],
    shape: tuple[int, int, int],
    origin: Float64[Array, " 3"],
    spacing: float,
) -> tuple[Float64[Array, "X Y Z"], bool]:
    """Signed distance [m] on a world-aligned grid to a densely sampled surface, and whether it is closed.

    Far from the surface the sign says whether filling the shell of its voxels reaches there; near it the
    side of the nearest sample's normal decides. Of an open surface everything is outside.
    """
    index = np.round((points - origin) / spacing).astype(int)
    shell = np.zeros(shape, bool)
    shell[tuple(np.clip(index, 0, np.array(shape) - 1).T)] = True
    # Samples leave pinholes in the shell: filled while it is thicker, then made thin again.
    cube = np.ones((3, 3, 3), bool)
    thick = ndimage.binary_dilation(np.pad(shell, 3), cube)
    solid = ndimage.binary_fill_holes(thick)
    enclosed = int(np.count_nonzero(solid & ~thick)) > 0
    filled = (ndimage.binary_erosion(solid, cube) | np.pad(shell, 3))[3:-3, 3:-3, 3:-3]
    deep, far = ndimage.distance_transform_edt(filled), ndimage.distance_transform_edt(~filled)
    signed = np.where(filled, deep, -far) * spacing
    # Surfaces inside the body (of overlapping parts) bound nothing.
    outer = deep[tuple(np.clip(index, 0, np.array(shape) - 1).T)] < 2.9
    points, normals = points[outer], normals[outer]
    near = (deep < 3.5) & (far < 3.5)
    centers = grid_points(shape, origin, np.eye(3), spacing)[near]
    gap, nearest = cKDTree(points).query(centers)
    side = np.einsum("ni,ni->n", centers - points[nearest], normals[nearest])
    decided = (deep[near] > 2.9) | (far[near] > 1.5)
    inside = np.where(decided, filled[near], side < 0) & enclosed
    signed[near] = np.where(inside, gap, -gap)
    return signed, enclosed


def mask_distance(mask: Bool[Array, "H W"]) -> Float32[Array, "H W"]:
    """Signed distance to the outline of a mask [px], positive inside; the image border is an outline."""
    padded = np.pad(mask, 1)
    inside = ndimage.distance_transform_edt(padded)
    outside = ndimage.distance_transform_edt(~padded)
    signed: Float32[Array, "H W"] = np.where(padded, inside - 0.5, 0.5 - outside)[1:-1, 1:-1].astype(
        np.float32
    )
    return signed


def sample_image(
    image: Float[Array, "H W"], pixels: Float[Array, "*n 2"], outside: float | None = None
) -> Float64[Array, "*n"]:
    """Bilinear samples of an image at pixels (x, y); beyond the border the edge value or `outside`."""
    coordinates = np.moveaxis(np.asarray(pixels, np.float64)[..., ::-1], -1, 0)
    mode = "nearest" if outside is None else "constant"
    sampled: Float64[Array, "*n"] = ndimage.map_coordinates(
        image, coordinates, order=1, mode=mode, cval=outside or 0.0, output=np.float64
    )
    return sampled


def cone_distance(
    points: Float[Array, "*n 3"], mask: Bool[Array, "H W"], camera: Camera
) -> Float64[Array, "*n"]:
    """How far inside the viewing cone of a mask world points are [m], negative outside."""
    pixels, depth = camera.project(points)
    outline = sample_image(mask_distance(mask), np.clip(pixels, -1e4, 1e4))
    # Past the border the distance to the border itself takes over.
    size = np.array([camera.width, camera.height])
    beyond = np.maximum(np.maximum(-0.5 - pixels, pixels - (size - 0.5)), 0.0).max(axis=-1)
    focal = float(np.sqrt(camera.intrinsics[0, 0] * camera.intrinsics[1, 1]))
    inside = np.where(beyond > 0, -beyond, outline) * np.abs(depth) / focal
    cone: Float64[Array, "*n"] = np.where(depth > 0, np.maximum(inside, -1e3), -1e3)
    return cone


def carved(volume: Volume, mask: Bool[Array, "H W"], camera: Camera) -> Volume:
    """The part of a body that a camera sees inside a mask."""
    cone = cone_distance(volume.points, mask, camera)
    distance = np.minimum(volume.distance, cone).astype(np.float32)
    return Volume(distance, volume.origin, volume.axes, volume.spacing)
