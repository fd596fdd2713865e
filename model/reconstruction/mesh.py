"""A mesh of the object, aligned to the keyframe and filled with Gaussians."""

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.reconstruction.alignment import Placement, align
from model.reconstruction.base import Reconstructor
from model.reconstruction.fill import Filling, fill
from model.reconstruction.mesh_file import Surface, read_mesh
from model.reconstruction.outline import overlap, silhouette_of
from model.reconstruction.paint import colors_from_image
from model.reconstruction.silhouette import SHEET_THICKNESS, completed_mask, pixel_size
from model.reconstruction.volume import Volume, distance_to_samples, grid_around
from model.types import Array, Calibration, Frames, Gaussians, Masks, ShapeClass

POOR_OVERLAP = 0.75


class MeshReconstructor(Reconstructor):
    """Places a given mesh so that its outline matches the keyframe's mask, and fills it.

    The mesh brings shape and, if it has any, colours; size and pose come from the keyframe. It may lie on
    any of its six sides: all are tried, each at every heading, and the best are refined.

    Args:
        path: GLB, OBJ or PLY file.
    """

    name: ClassVar[str] = "mesh"
    version: ClassVar[str] = "1"

    def __init__(self, path: Path | str) -> None:
        """Read and check the mesh.

        Raises:
            InputError: the file is no mesh of a supported format, or too large.
        """
        self.path = Path(path)
        self.surface, self.weights = read_mesh(self.path)

    def __call__(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> Gaussians:
        """Reconstruct the object on the keyframe."""
        image, object_mask = frames.images[masks.keyframe], masks.object[masks.keyframe]
        mask = completed_mask(object_mask, masks.hand[masks.keyframe])
        placement = align(self.surface, image, mask, calibration)
        volume = volume_of(self.surface, placement)
        filling = fill(volume, pixel_size(mask, calibration), calibration.ground_height)
        colors = self._colors(filling, placement)
        if colors is None:
            colors = colors_from_image(filling, calibration.camera, image, object_mask)
        gaussians = filling.painted(colors)
        score = overlap(silhouette_of(gaussians, calibration.camera), mask)
        doubts = self.surface.warnings
        if score < POOR_OVERLAP:
            poor = f"the mesh {self.path.name} fits the keyframe's mask with an overlap of only {score:.2f}"
            doubts += (poor,)
        return replace(gaussians, warnings=doubts)

    def extent(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> float:
        """Longest side [m] of the mesh's own box where it matches the mask.

        The silhouette's extent would be another: it is a guess at the side that the camera does not see.
        """
        mask = completed_mask(masks.object[masks.keyframe], masks.hand[masks.keyframe])
        return align(self.surface, frames.images[masks.keyframe], mask, calibration).scale

    def _colors(self, filling: Filling, placement: Placement) -> Float64[Array, "G 3"] | None:
        """The mesh's own colours (0..1) at the Gaussians, if it has any."""
        if self.surface.colors is None:
            return None
        _, nearest = cKDTree(placement.apply(self.surface.points)).query(filling.means)
        colors: Float64[Array, "G 3"] = self.surface.colors[nearest]
        return colors


def volume_of(surface: Surface, placement: Placement) -> Volume:
    """The body a placed surface encloses; an open surface becomes a thin shell around itself."""
    points = placement.apply(surface.points)
    normals = surface.normals @ placement.rotation.T
    shape, origin, spacing = grid_around(points.min(0), points.max(0), np.eye(3), 1e-5)
    distance, enclosed = distance_to_samples(points, normals, shape, origin, spacing)
    if not enclosed:
        distance = np.maximum(0.5 * SHEET_THICKNESS, spacing) - np.abs(distance)
    return Volume(distance.astype(np.float32), origin, np.eye(3), spacing)
