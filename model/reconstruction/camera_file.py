"""Reading a camera file: intrinsics, and if known the pose, the ground and gravity.

Format (JSON; lengths in metres, OpenCV camera axes: x right, y down, z forward)::

    {
      "intrinsics": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]],     // or {"fx": …, "fy": …, "cx": …, "cy": …}
      "width": 848, "height": 480,          // optional: the size the intrinsics belong to
      "world_from_camera": [[…], […], […], [0, 0, 0, 1]],       // optional: pose, 4×4
      "ground_height": 0.0,                 // optional: height of the ground plane along "up" (−gravity)
      "gravity": [0, 0, -9.81]              // optional: in the file's world; (0, 0, 9.81) for a z-down world
    }

Without a pose, pitch and roll are estimated from the image. A world whose gravity is not along −z is
turned upright; `ground_height` is measured against gravity, so it needs no change by that.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from model.errors import InputError
from model.types import STANDARD_GRAVITY, Array

KEYS = ("intrinsics", "width", "height", "world_from_camera", "ground_height", "gravity")
MAXIMUM_BYTES = 1_000_000
NARROWEST, WIDEST = 1.0, 170.0
"""What a lens sees of the width [degrees]."""


@dataclass(frozen=True)
class CameraFile:
    """What a camera file says, in an upright world."""

    intrinsics: Float64[Array, "3 3"]
    """K [px] at the size of the clip."""
    world_from_camera: Float64[Array, "4 4"] | None
    """Pose [m], z up."""
    ground_height: float | None
    """z of the ground [m]."""
    gravity: tuple[float, float, float]
    """[m/s²], along −z."""


def read_camera_file(path: Path, width: int, height: int) -> CameraFile:
    """Read and check a camera file.

    Args:
        path: The JSON file.
        width: Of the clip [px]; intrinsics of another size are rescaled.
        height: Of the clip [px].

    Raises:
        InputError: the file cannot be read or a key does not hold what it must.
    """
    entries = _entries(path)
    intrinsics = _intrinsics(entries, path)
    if "width" in entries or "height" in entries:
        size = [_number(entries.get(key), key, path) for key in ("width", "height")]
        if min(size) <= 0:
            raise _wrong(path, "width", "positive numbers of pixels for width and height", size)
        if abs(size[0] / size[1] - width / height) > 0.02 * width / height:
            raise _wrong(path, "width", f"the aspect ratio of the clip ({width}×{height})", size)
        # Pixel centres are at whole numbers, so the corner of the image is at −0.5.
        ratio = np.array([width / size[0], height / size[1]])
        intrinsics[:2, 2] = (intrinsics[:2, 2] + 0.5) * ratio - 0.5
        intrinsics[0, :2] *= ratio[0]
        intrinsics[1, 1] *= ratio[1]
    _check_plausible(intrinsics, path, width, height)
    pose = _pose(entries["world_from_camera"], path) if "world_from_camera" in entries else None
    ground = _number(entries["ground_height"], "ground_height", path) if "ground_height" in entries else None
    if ground is not None and pose is None:
        raise InputError(
            f"{path}: ground_height means nothing without world_from_camera; add it or drop both"
        )
    gravity = _numbers(entries.get("gravity", STANDARD_GRAVITY), "gravity", path, (3,))
    strength = float(np.linalg.norm(gravity))
    if strength < 1e-6:
        raise _wrong(path, "gravity", "a vector with a direction", entries["gravity"])
    if pose is not None:
        upright = np.eye(4)
        upright[:3, :3] = _rotation_between(-gravity / strength, np.array([0.0, 0.0, 1.0]))
        pose = upright @ pose
    return CameraFile(intrinsics, pose, ground, (0.0, 0.0, -strength))


def _entries(path: Path) -> dict[str, object]:
    try:
        if path.stat().st_size > MAXIMUM_BYTES:
            raise InputError(
                f"{path}: a camera file has at most {MAXIMUM_BYTES} bytes; is this the right file?"
            )
        entries = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: the camera file cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path}: the camera file is not valid JSON") from None
    if not isinstance(entries, dict) or "intrinsics" not in entries:
        raise InputError(f"{path}: the camera file must be a JSON object with the key intrinsics")
    unknown = sorted(set(entries) - set(KEYS))
    if unknown:
        raise InputError(f"{path}: unknown key {unknown[0]!r}; a camera file may hold {', '.join(KEYS)}")
    return entries


def _intrinsics(entries: dict[str, object], path: Path) -> Float64[Array, "3 3"]:
    given = entries["intrinsics"]
    if isinstance(given, dict):
        unknown = sorted(set(given) - {"fx", "fy", "cx", "cy"})
        if unknown:
            raise InputError(
                f"{path}: unknown key intrinsics.{unknown[0]}: it may hold fx, fy, cx, cy "
                "(undistort the clip before)"
            )
        values = {key: _number(given.get(key), f"intrinsics.{key}", path) for key in ("fx", "fy", "cx", "cy")}
        matrix = np.array(
            [[values["fx"], 0, values["cx"]], [0, values["fy"], values["cy"]], [0, 0, 1]], np.float64
        )
    else:
        matrix = _numbers(given, "intrinsics", path, (3, 3))
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise _wrong(path, "intrinsics", "positive focal lengths", [matrix[0, 0], matrix[1, 1]])
    if not np.allclose(matrix[[1, 2, 2, 2], [0, 0, 1, 2]], [0, 0, 0, 1]):
        raise _wrong(path, "intrinsics", "the form [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]", given)
    return matrix


def _check_plausible(intrinsics: Float64[Array, "3 3"], path: Path, width: int, height: int) -> None:
    """Refuse intrinsics of another picture: of a larger one, or of a lens in millimetres.

    Raises:
        InputError: the principal point is outside of the clip, or hardly anything or everything is in view.
    """
    fx, (cx, cy) = float(intrinsics[0, 0]), intrinsics[:2, 2].tolist()
    if not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
        raise InputError(
            f"{path}: intrinsics: the principal point ({cx:g}, {cy:g}) is outside of the clip's "
            f"{width}×{height} pixels: give the width and height that they belong to"
        )
    view = float(np.rad2deg(2.0 * np.arctan(0.5 * width / fx)))
    if not NARROWEST < view < WIDEST:
        raise InputError(
            f"{path}: intrinsics: a focal length of {fx:g} px sees {view:.3g}° of the clip's {width} px: "
            "give it in pixels, with the width and height that it belongs to"
        )


def _pose(given: object, path: Path) -> Float64[Array, "4 4"]:
    matrix = _numbers(given, "world_from_camera", path, (4, 4))
    rotation = matrix[:3, :3]
    if not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
        raise _wrong(path, "world_from_camera", "a last row of 0 0 0 1", matrix[3].tolist())
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise InputError(f"{path}: world_from_camera must hold a rotation, its 3×3 part is not orthonormal")
    left, _, right = np.linalg.svd(rotation)
    matrix[:3, :3] = left @ right  # files round their digits
    return matrix


def _numbers(given: object, key: str, path: Path, shape: tuple[int, ...]) -> Float64[Array, "*shape"]:
    try:
        values = np.array(given, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise _wrong(path, key, f"numbers of shape {list(shape)}", given) from None
    if values.shape != shape:
        raise _wrong(path, key, f"numbers of shape {list(shape)}", f"shape {list(values.shape)}")
    if not np.isfinite(values).all():
        raise _wrong(path, key, "finite numbers", "NaN or infinity")
    return values


def _number(given: object, key: str, path: Path) -> float:
    try:
        number = float(given) if isinstance(given, int | float) and not isinstance(given, bool) else np.nan
    except OverflowError:  # an integer of more than 308 digits
        number = np.inf
    if not np.isfinite(number):
        raise _wrong(path, key, "a finite number", given)
    return number


def _wrong(path: Path, key: str, expected: str, found: object) -> InputError:
    shown = str(found).replace("\n", " ")
    return InputError(f"{path}: {key} must be {expected}, found {shown[:80]}")


def _rotation_between(source: Float64[Array, " 3"], target: Float64[Array, " 3"]) -> Float64[Array, "3 3"]:
    """The smallest rotation that turns one unit vector into another (Rodrigues)."""
    cosine = float(source @ target)
    if cosine < -1.0 + 1e-9:  # opposite: half a turn about x keeps x (PhysTwin's z-down worlds)
        return np.diag([1.0, -1.0, -1.0]) if abs(source[0]) < 1e-6 else np.diag([-1.0, 1.0, -1.0])
    v = np.cross(source, target)
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    rotation: Float64[Array, "3 3"] = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return rotation
