"""Which pose and size of a known shape matches a mask: search over headings and sides, then refinement."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64, UInt8
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from model.reconstruction.balls import plane_points
from model.reconstruction.mesh_file import Surface
from model.reconstruction.silhouette import pixel_size
from model.types import Array, Calibration, Camera

HEADINGS = 24
COARSE_SIDE, FINE_SIDE = 72, 160
"""Longer side of the mask's box in the two search images [px]."""
COLOR_WEIGHT = 0.4
"""What a colour difference of 1 costs against an overlap of 1: tells front from back."""
KEPT = 4


@dataclass(frozen=True)
class Placement:
    """A similarity: rotation, scale, translation."""

    rotation: Float64[Array, "3 3"]
    scale: float
    translation: Float64[Array, " 3"]
    """[m]."""

    def apply(self, points: Float[Array, "N 3"]) -> Float64[Array, "N 3"]:
        """Points of the unit shape in the world [m]."""
        placed: Float64[Array, "N 3"] = self.scale * points @ self.rotation.T + self.translation
        return placed


@dataclass(frozen=True)
class _Target:
    """The mask in a small image around it, and how points get there."""

    mask: Bool[Array, "h w"]
    image: Float64[Array, "h w 3"]
    camera: Camera
    points: Float64[Array, "N 3"]
    normals: Float64[Array, "N 3"]
    colors: Float64[Array, "N 3"] | None
    ground: float | None
    depth: float
    """Of the object where there is no ground [m]."""

    def place(self, rotation: Float64[Array, "3 3"], scale: float, pixel: Float64[Array, " 2"]) -> Placement:
        """The shape with its middle seen at `pixel`, resting on the ground or at the known depth."""
        turned = scale * self.points @ rotation.T
        if self.ground is None:
            return Placement(rotation, scale, self.camera.unproject(pixel[None], np.array([self.depth]))[0])
        lift = -float(turned[:, 2].min())
        up = np.array([0.0, 0.0, 1.0])
        foot = plane_points(self.camera, pixel[None], up, self.ground + lift)[0]
        return Placement(rotation, scale, foot)

    def render(self, placement: Placement) -> tuple[Bool[Array, "h w"], float]:
        """Outline of the placed shape, and the mean colour difference of its visible points (0..1)."""
        height, width = self.mask.shape
        world = placement.apply(self.points)
        pixels, depth = self.camera.project(world)
        corner = np.round(pixels).astype(int)
        inside = (corner >= 0).all(-1) & (corner[:, 0] < width) & (corner[:, 1] < height) & (depth > 0)
        outline = np.zeros((height, width), np.uint8)
        outline[corner[inside, 1], corner[inside, 0]] = 1
        closed = np.asarray(cv2.morphologyEx(outline, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))) > 0
        if self.colors is None:
            return closed, 0.0
        away = world - self.camera.position
        shown = inside & (np.einsum("ni,ni->n", self.normals @ placement.rotation.T, away) < 0)
        shown[shown] = self.mask[corner[shown, 1], corner[shown, 0]]
        if not shown.any():
            return closed, 1.0
        seen = self.image[corner[shown, 1], corner[shown, 0]]
        return closed, float(np.abs(seen - self.colors[shown]).mean())

    def loss(self, placement: Placement) -> float:
        """1 − overlap, plus what colours say."""
        outline, difference = self.render(placement)
        union = max(int(np.count_nonzero(outline | self.mask)), 1)
        return 1.0 - np.count_nonzero(outline & self.mask) / union + COLOR_WEIGHT * difference


def align(
    surface: Surface, image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"], calibration: Calibration
) -> Placement:
    """The placement of a surface whose outline matches a mask best.

    Resting on the ground (if there is one) on any of its six sides at any heading; then heading, a small
    tilt, scale and position are refined on the overlap of outlines. Deterministic.
    """
    coarse = _target(surface, image, mask, calibration, COARSE_SIDE, 4_000)
    starts = []
    for side in range(6):
        for heading in range(HEADINGS):
            turn = Rotation.from_euler("z", 2.0 * np.pi * heading / HEADINGS) * _SIDES[side]
            placement, pixel = _fitted(coarse, turn.as_matrix())
            starts.append((coarse.loss(placement), side * HEADINGS + heading, placement, pixel))
    starts.sort(key=lambda start: start[:2])
    fine = _target(surface, image, mask, calibration, FINE_SIDE, 15_000)
    zoom = fine.camera.intrinsics[0, 0] / coarse.camera.intrinsics[0, 0]
    best: tuple[float, Placement] | None = None
    for _, _, placement, pixel in starts[:KEPT]:
        refined = _refined(coarse, placement, pixel, 1.0, 120)
        shifted = (refined[2] + 0.5) * zoom - 0.5
        found = _refined(fine, refined[1], shifted, 0.4, 90)
        if best is None or found[0] < best[0]:
            best = found[:2]
    assert best is not None
    return best[1]


_SIDES = (
    Rotation.identity(),
    Rotation.from_euler("x", 90, degrees=True),
    Rotation.from_euler("x", -90, degrees=True),
    Rotation.from_euler("x", 180, degrees=True),
    Rotation.from_euler("y", 90, degrees=True),
    Rotation.from_euler("y", -90, degrees=True),
)
"""z up as given, y up (GLB), and the other four."""


def _target(
    surface: Surface,
    image: UInt8[Array, "H W 3"],
    mask: Bool[Array, "H W"],
    calibration: Calibration,
    side: int,
    count: int,
) -> _Target:
    """The search problem on a small image around the mask."""
    rows, columns = np.nonzero(mask)
    zoom = side / max(np.ptp(rows) + 1, np.ptp(columns) + 1)
    margin = 0.35 * side / zoom
    corner = np.array([columns.min() - margin, rows.min() - margin])
    size = np.array([np.ptp(columns) + 1, np.ptp(rows) + 1]) + 2.0 * margin
    width, height = (int(v) for v in np.ceil(size * zoom))
    affine = np.array([[zoom, 0.0, -zoom * corner[0]], [0.0, zoom, -zoom * corner[1]]])
    intrinsics = np.vstack([affine, [0.0, 0.0, 1.0]]) @ calibration.camera.intrinsics
    flags = cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR
    small = cv2.warpAffine(mask.astype(np.float32), affine, (width, height), flags=flags) > 0.5
    picture = cv2.warpAffine(image, affine, (width, height), flags=flags).astype(np.float64) / 255.0
    step = max(1, len(surface.points) // count)
    return _Target(
        mask=small,
        image=picture,
        camera=Camera(intrinsics, calibration.camera.world_from_camera, width, height),
        points=surface.points[::step],
        normals=surface.normals[::step],
        colors=None if surface.colors is None else surface.colors[::step],
        ground=calibration.ground_height,
        depth=pixel_size(mask, calibration) * float(calibration.camera.intrinsics[0, 0]),
    )


def _fitted(target: _Target, rotation: Float64[Array, "3 3"]) -> tuple[Placement, Float64[Array, " 2"]]:
    """Scale and position for one rotation: match the outline's area and middle, by a few steps."""
    rows, columns = np.nonzero(target.mask)
    middle, area = np.array([columns.mean(), rows.mean()]), len(rows)
    pixel, scale = middle, 0.5 * target.depth * float(np.sqrt(area)) / target.camera.intrinsics[0, 0]
    for _ in range(3):
        outline, _ = target.render(target.place(rotation, scale, pixel))
        rows, columns = np.nonzero(outline)
        if len(rows) == 0:
            break
        pixel = pixel + middle - np.array([columns.mean(), rows.mean()])
        scale *= float(np.clip(np.sqrt(area / len(rows)), 0.3, 3.0))
    return target.place(rotation, scale, pixel), pixel


def _refined(
    target: _Target, start: Placement, pixel: Float64[Array, " 2"], reach: float, evaluations: int
) -> tuple[float, Placement, Float64[Array, " 2"]]:
    """Nelder–Mead over heading, tilt, scale and position from one start."""
    unit = reach * np.array([0.15, 0.1, 0.1, 0.08, 3.0, 3.0])

    def placed(values: Float64[Array, " 6"]) -> Placement:
        yaw, first, second, growth, right, down = values * unit
        turn = Rotation.from_euler("z", yaw) * Rotation.from_rotvec([first, second, 0.0])
        rotation = turn.as_matrix() @ start.rotation
        return target.place(rotation, start.scale * np.exp(growth), pixel + np.array([right, down]))

    simplex = np.vstack([np.zeros(6), np.eye(6)])
    result = minimize(
        lambda values: target.loss(placed(values)),
        np.zeros(6),
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": evaluations, "xatol": 1e-3, "fatol": 1e-4},
    )
    return float(result.fun), placed(result.x), pixel + (result.x * unit)[4:]
