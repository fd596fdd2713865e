"""Keyframe → Gaussians with volume: by inflating the silhouette, from a mesh, or from depth.

`cameras.calibrate` fixes camera, gravity, ground and scale; a method of `ALL_RECONSTRUCTORS` then builds the
body. They share one path: a signed-distance `Volume`, filled with Gaussians (`fill`) that are coloured from
the keyframe (`paint`).
"""

from model.reconstruction.base import Reconstructor
from model.reconstruction.depth import DepthReconstructor
from model.reconstruction.mesh import MeshReconstructor
from model.reconstruction.silhouette import SilhouetteReconstructor

ALL_RECONSTRUCTORS: tuple[type[Reconstructor], ...] = (
    SilhouetteReconstructor,
    MeshReconstructor,
    DepthReconstructor,
)

__all__ = [
    "ALL_RECONSTRUCTORS",
    "DepthReconstructor",
    "MeshReconstructor",
    "Reconstructor",
    "SilhouetteReconstructor",
]
