"""The motion as a glTF animation, for any viewer of 3D files."""

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float32, Float64, UInt32

from model.exports.base import Exporter
from model.exports.gltf import GltfWriter
from model.exports.mechanics import point_colors, point_radius, roll
from model.exports.moving import EVERY_EFFECT
from model.exports.readme import write_readme
from model.formats.files import replacing
from model.types import Array, Trajectory

if TYPE_CHECKING:
    from model.bundle import TwinBundle

CORNERS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float32)
"""Of an octahedron."""
FACES = np.array(
    [[4, 0, 2], [4, 2, 1], [4, 1, 3], [4, 3, 0], [5, 2, 0], [5, 1, 2], [5, 3, 1], [5, 0, 3]], np.uint32
)
"""Of an octahedron, anticlockwise from outside."""
HAND = (0.9, 0.3, 0.2)
"""Colour of the controllers."""
FRAME = (
    "glTF: metres, y up. The points are stored as the twin has them, z up, below a node that turns them. "
    "Time in seconds. Colours are linear RGB."
)


class GlbExporter(Exporter):
    """One GLB: an octahedron per point and per controller, and a morph target per frame.

    At every moment two targets at most have a weight, so that viewers that blend only a few play it too.

    Reference:
        Khronos Group (2021), glTF 2.0 specification, sections 3.7.2.2 (morph targets) and 3.11 (animations).
    """

    name: ClassVar[str] = "glb"
    expressed: ClassVar[frozenset[str]] = EVERY_EFFECT
    simulated: ClassVar[bool] = False

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the file `out`."""
        trajectory = roll(twin)
        with replacing(out) as temporary:
            temporary.write_bytes(_write(twin, trajectory))
        return [out]


def _write(twin: "TwinBundle", trajectory: Trajectory) -> bytes:
    places, colors = _places(twin, trajectory), point_colors(twin)
    hands = places.shape[1] - len(colors)
    colors = np.concatenate([colors, np.tile(HAND, (hands, 1))])
    corners = CORNERS * np.float32(point_radius(twin.topology.points.astype(np.float64)))
    file = GltfWriter(_readme(twin, trajectory), "MatPhys")
    mesh = {
        "POSITION": file.add((places[0][:, None] + corners).reshape(-1, 3), bounds=True, target="vertices"),
        "COLOR_0": file.add(np.repeat(_linear(colors), len(CORNERS), axis=0), target="vertices"),
    }
    indices = file.add(_faces(len(colors)).ravel(), target="indices")
    targets = [
        {
            "POSITION": file.add(
                np.repeat(moved - places[0], len(CORNERS), axis=0), bounds=True, target="vertices"
            )
        }
        for moved in places[1:]
    ]
    node = file.add_mesh("points", mesh, indices, targets)
    if targets:
        weights = np.eye(len(places), dtype=np.float32)[:, 1:]
        file.animate(node, "motion", trajectory.times.astype(np.float32), weights.ravel())
    return file.encode()


def _places(twin: "TwinBundle", trajectory: Trajectory) -> Float32[Array, "T n 3"]:
    """Points, then controllers, in every frame [m]."""
    if twin.controls is None:
        return trajectory.points
    return np.concatenate([trajectory.points, twin.controls], axis=1)


def _faces(count: int) -> UInt32[Array, "F 3"]:
    shifted = FACES[None] + np.arange(0, count * len(CORNERS), len(CORNERS), dtype=np.uint32)[:, None, None]
    faces: UInt32[Array, "F 3"] = shifted.reshape(-1, 3)
    return faces


def _linear(colors: Float64[Array, "n 3"]) -> Float32[Array, "n 3"]:
    """Turn sRGB into linear RGB, which vertex colours are in."""
    low, high = colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4
    return np.where(colors <= 0.04045, low, high).astype(np.float32)


def _readme(twin: "TwinBundle", trajectory: Trajectory) -> str:
    return write_readme(
        twin,
        "A MatPhys twin as an animation",
        files=[("this file", f"an octahedron per point, {len(trajectory.times)} frames as morph targets")],
        frame=FRAME,
        limits=[
            "It is a recording: springs, masses and parameters are not in it.",
            "The Gaussians are not in it: points stand for them, in their mean colours.",
            "A viewer that allows few morph targets in a file may refuse a long motion.",
        ],
    )
