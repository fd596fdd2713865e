"""Which way is up: pitch and roll of the camera from the straight lines of the scene."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64, UInt8

from model.types import Array

TOLERANCE = np.deg2rad(1.5)
"""Spread of a line's direction about its vanishing point [rad]."""
MINIMUM_LINES = 3
"""Lines that must agree, besides the level ones, before pitch is believed."""
MINIMUM_LINES_FOR_FOCAL = 12


@dataclass(frozen=True)
class Tilt:
    """Attitude of a camera against gravity."""

    pitch: float
    """How far it looks down [rad]."""
    roll: float
    """Clockwise rotation of the scene in the image [rad]."""
    reliable: bool
    """Whether lines fix it; otherwise it is the default."""
    evidence: str
    """One phrase on where it comes from."""

    @property
    def up(self) -> Float64[Array, " 3"]:
        """Unit vector against gravity in camera coordinates."""
        return _up(np.array(self.pitch), np.array(self.roll))


def tilt_from_lines(
    image: UInt8[Array, "H W 3"],
    ignore: Bool[Array, "H W"],
    intrinsics: Float64[Array, "3 3"],
    default_pitch: float,
) -> Tilt:
    """Pitch and roll from line segments that are level, run into the depth, or stand upright.

    One box-shaped frame (up, and two level directions at right angles) is searched for that explains as
    much line length as possible. Where the lines leave the pitch open, the default is returned.

    Args:
        image: The keyframe, best without the moving things.
        ignore: Pixels whose lines say nothing about gravity: the object and the hand.
        intrinsics: K [px].
        default_pitch: What to answer without evidence [rad], and the middle of the weak prior.

    Reference:
        Coughlan and Yuille (1999), Manhattan world: compass direction from a single image.
    """
    segments = _segments(image, ignore)
    if len(segments) < MINIMUM_LINES:
        return Tilt(default_pitch, 0.0, False, f"only {len(segments)} straight lines in the image")
    pitch, roll, yaw = _best_frame(segments, intrinsics, default_pitch)
    return _verdict(segments, intrinsics, pitch, roll, yaw, default_pitch)


def field_of_view_from_lines(
    image: UInt8[Array, "H W 3"], ignore: Bool[Array, "H W"], default_pitch: float
) -> float | None:
    """Field of view of the longer side [rad], where level and upright lines together fix it; else None.

    Lines on a table and upright lines each tell the pitch, but agree on it for one focal length only.
    Believed only if that one stands out from all others.
    """
    segments = _segments(image, ignore)
    if len(segments) < MINIMUM_LINES_FOR_FOCAL:
        return None
    coarse = np.deg2rad(np.arange(45.0, 111.0, 5.0))
    scores = np.array([_explained(image, ignore, segments, fov, default_pitch) for fov in coarse])
    best = int(scores.argmax())
    beside = scores[np.abs(np.arange(len(coarse)) - best) > 1]
    if scores[best] - float(np.quantile(beside, 0.9)) < 0.02 or best in (0, len(coarse) - 1):
        return None
    fine = coarse[best] + np.deg2rad(np.arange(-4.0, 4.1, 1.0))
    weights = np.array([_explained(image, ignore, segments, fov, default_pitch) for fov in fine])
    weights = np.maximum(weights - 0.5 * (weights.max() + np.median(beside)), 0.0)
    return float((fine * weights).sum() / weights.sum())


def intrinsics_for(field_of_view: float, width: int, height: int) -> Float64[Array, "3 3"]:
    """K [px] of a centred camera whose longer side spans `field_of_view` [rad]."""
    focal = 0.5 * max(width, height) / np.tan(0.5 * field_of_view)
    return np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])


def _explained(
    image: UInt8[Array, "H W 3"],
    ignore: Bool[Array, "H W"],
    segments: Float64[Array, "L 4"],
    field_of_view: float,
    default_pitch: float,
) -> float:
    """Share of the line length that the best frame explains with this field of view."""
    intrinsics = intrinsics_for(field_of_view, image.shape[1], image.shape[0])
    pitch, roll, yaw = _best_frame(segments, intrinsics, default_pitch)
    votes = _votes(segments, intrinsics, np.array([pitch]), np.array([roll]), np.array([yaw]), TOLERANCE)
    return float(votes.sum() / _weights(segments).sum())


def _best_frame(
    segments: Float64[Array, "L 4"], intrinsics: Float64[Array, "3 3"], default_pitch: float
) -> tuple[float, float, float]:
    """Pitch, roll and yaw [rad] of the frame that explains most line length: a grid, then two finer ones."""
    pitches = np.deg2rad(np.arange(4.0, 87.0, 3.0))
    rolls = np.deg2rad(np.arange(-10.0, 10.1, 2.0))
    yaws = np.deg2rad(np.arange(0.0, 90.0, 3.0))
    tolerance = 2.0 * TOLERANCE
    for width in (1.5, 0.5, 0.0):
        votes = _votes(segments, intrinsics, pitches, rolls, yaws, tolerance)
        score = votes.sum(-1) + _prior(pitches, rolls, default_pitch, segments)
        i, j, k = np.unravel_index(int(score.argmax()), score.shape)
        grid = np.deg2rad(np.linspace(-2.0 * width, 2.0 * width, 9))
        pitches, rolls, yaws, tolerance = pitches[i] + grid, rolls[j] + grid, yaws[k] + grid, TOLERANCE
    return float(pitches[0]), float(rolls[0]), float(yaws[0])


def _verdict(
    segments: Float64[Array, "L 4"],
    intrinsics: Float64[Array, "3 3"],
    pitch: float,
    roll: float,
    yaw: float,
    default_pitch: float,
) -> Tilt:
    """Believe the best pitch only if several lines lose their agreement ten degrees beside it."""
    around = pitch + np.deg2rad(np.array([-10.0, 0.0, 10.0]))
    free = np.deg2rad(np.arange(-8.0, 8.1, 2.0))
    votes = _votes(segments, intrinsics, around, roll + free, yaw + free, TOLERANCE)
    here = _votes(segments, intrinsics, np.array([pitch]), np.array([roll]), np.array([yaw]), TOLERANCE)[
        0, 0, 0
    ]
    best_beside = [votes[i].reshape(-1, len(segments)).sum(-1).max() for i in (0, 2)]
    margin = (here.sum() - max(best_beside)) / max(_weights(segments).sum(), 1e-9)
    agreeing = int((here > 0.5 * _weights(segments)).sum())
    reliable = bool(margin > 0.06 and agreeing >= MINIMUM_LINES + 1)
    evidence = f"{agreeing} of {len(segments)} straight lines agree, margin {margin:.2f}"
    if not reliable:
        return Tilt(default_pitch, 0.0, False, f"straight lines do not tell what is upright ({evidence})")
    return Tilt(pitch, roll, True, evidence)


def _segments(image: UInt8[Array, "H W 3"], ignore: Bool[Array, "H W"]) -> Float64[Array, "L 4"]:
    """Ends (x0, y0, x1, y1) of long straight lines outside `ignore` [px]."""
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    found: object = cv2.createLineSegmentDetector().detect(gray)[0]
    if found is None:
        return np.zeros((0, 4))
    lines = np.asarray(found, np.float64).reshape(-1, 4)
    size = max(image.shape[:2])
    lines = lines[np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]) > 0.05 * size]
    share = np.linspace(0.0, 1.0, 9)[None, :, None]
    along = lines[:, None, :2] * (1 - share) + lines[:, None, 2:] * share
    index = np.clip(np.round(along).astype(int), 0, [image.shape[1] - 1, image.shape[0] - 1])
    covered = ignore[index[..., 1], index[..., 0]].mean(axis=1)
    kept: Float64[Array, "L 4"] = lines[covered < 0.25]
    return kept


def _weights(segments: Float64[Array, "L 4"]) -> Float64[Array, " L"]:
    """A line's say: its length, so that no single one decides alone [px]."""
    length = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    weights: Float64[Array, " L"] = np.minimum(length, 4.0 * np.median(length))
    return weights


def _votes(
    segments: Float64[Array, "L 4"],
    intrinsics: Float64[Array, "3 3"],
    pitches: Float64[Array, " P"],
    rolls: Float64[Array, " R"],
    yaws: Float64[Array, " Y"],
    tolerance: float,
) -> Float64[Array, "P R Y L"]:
    """How well each line fits the nearest of the three directions of each frame."""
    pitch, roll, yaw = np.meshgrid(pitches, rolls, yaws, indexing="ij")
    up = _up(pitch, roll)
    right = np.stack([np.cos(roll), np.sin(roll), np.zeros_like(roll)], axis=-1)
    ahead = np.cross(up, right)
    c, s = np.cos(yaw)[..., None], np.sin(yaw)[..., None]
    middle = 0.5 * (segments[:, :2] + segments[:, 2:])
    along = segments[:, 2:] - segments[:, :2]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    best = np.zeros((*pitch.shape, len(segments)))
    for direction in (up, c * right + s * ahead, c * ahead - s * right):
        vanishing = direction @ intrinsics.T
        # Homogeneous: (vanishing point − middle) × weight, so that points at infinity need no care.
        towards = [vanishing[..., i, None] - vanishing[..., 2, None] * middle[:, i] for i in (0, 1)]
        sine = (towards[0] * along[:, 1] - towards[1] * along[:, 0]) / np.maximum(
            np.hypot(towards[0], towards[1]), 1e-9
        )
        best = np.maximum(best, np.exp(-0.5 * (sine / tolerance) ** 2))
    votes: Float64[Array, "P R Y L"] = best * _weights(segments)
    return votes


def _prior(
    pitches: Float64[Array, " P"],
    rolls: Float64[Array, " R"],
    default_pitch: float,
    segments: Float64[Array, "L 4"],
) -> Float64[Array, "P R 1"]:
    """People hold cameras level and about as steeply as the default."""
    strength = 0.05 * _weights(segments).sum()
    pitch = ((pitches - default_pitch) / np.deg2rad(20.0)) ** 2
    roll = (rolls / np.deg2rad(5.0)) ** 2
    prior: Float64[Array, "P R 1"] = -0.5 * strength * (pitch[:, None, None] + roll[None, :, None])
    return prior


def _up(pitch: Float64[Array, "*n"], roll: Float64[Array, "*n"]) -> Float64[Array, "*n 3"]:
    """Against gravity in camera coordinates (x right, y down, z forward)."""
    return np.stack([np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll), -np.sin(pitch)], axis=-1)
