"""A PhysTwin case (`final_data.pkl`) → an observation."""

import warnings
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from model.errors import InputError
from model.observation import parse_observation
from model.observe.arrays_pickle import read_pickled_arrays
from model.types import Array, Observation

FPS = 30.0
"""Of the cameras [1/s]."""
TURN = np.array([1.0, -1.0, -1.0])
"""Its world has z down: half a turn about x makes it up."""


def observe_phystwin(path: Path, fps: float = FPS) -> Observation:
    """Read the tracked points, their visibility, the hand and the colours; the table is z = 0.

    A point counts as seen in a frame where its track is visible and moved validly since the frame before.

    Args:
        path: `final_data.pkl`. Nothing in it but arrays is read.
        fps: Frames per second [1/s].

    Raises:
        InputError: not such a file, or one that lacks or contradicts what an observation needs.

    Reference:
        Jiang et al. (2025), PhysTwin: physics-informed reconstruction and simulation of deformable objects.
    """
    if not fps > 0.0:
        raise InputError(f"--fps {fps:g}: expected more than 0")
    return observe_arrays(read_pickled_arrays(path), path.name, fps)


def observe_arrays(arrays: dict[str, Array], name: str, fps: float = FPS) -> Observation:
    """The same, of what such a file holds; `name` is what messages call it.

    Raises:
        InputError: as `observe_phystwin`.
    """
    points = _required(arrays, "object_points", name)
    controllers = _required(arrays, "controller_points", name)
    if points.ndim != 3 or points.shape[2] != 3:
        raise InputError(f"{name}: object_points: expected shape [T, N, 3], found {list(points.shape)}")
    if controllers.ndim != 3 or controllers.shape[2] != 3:
        raise InputError(
            f"{name}: controller_points: expected shape [T, C, 3], found {list(controllers.shape)}"
        )
    frames = min(len(points), len(controllers))
    seen = _seen(arrays, points.shape[:2], name)
    turned = np.where(seen[..., None], points * TURN, np.nan)[:frames]
    content = {
        "times": np.arange(frames) / fps,
        "points": turned,
        "controllers": controllers[:frames] * TURN,
        "ground_height": np.array(0.0),
    }
    colors = arrays.get("object_colors")
    if colors is not None:
        content["colors"] = _colors(colors, points.shape[1], name)
    observation = parse_observation(content, name)
    if len(points) != len(controllers):
        counts = f"{len(points)} frames of the object and {len(controllers)} of the hand"
        warnings.warn(f"{name}: {counts}: the first {frames} are taken", stacklevel=2)
    return observation


def _required(arrays: dict[str, Array], key: str, name: str) -> Array:
    if key not in arrays:
        raise InputError(f"{name}: {key}: expected an array of numbers, found no such key")
    return arrays[key]


def _seen(arrays: dict[str, Array], shape: tuple[int, ...], name: str) -> Bool[Array, "T N"]:
    seen = np.ones(shape, bool)
    visible, valid = arrays.get("object_visibilities"), arrays.get("object_motions_valid")
    # row t of the second judges the motion from frame t to t + 1: the last frame needs none
    wanted = (("object_visibilities", visible, shape[0]), ("object_motions_valid", valid, shape[0] - 1))
    for key, flags, rows in wanted:
        if flags is None:
            continue
        if flags.ndim != 2 or flags.shape[1] != shape[1] or len(flags) < rows:
            raise InputError(f"{name}: {key}: expected shape {list(shape)}, found {list(flags.shape)}")
        if not np.isfinite(flags).all():
            raise InputError(f"{name}: {key}: expected true or false, found NaN or infinity")
    if visible is not None:
        seen &= visible[: shape[0]].astype(bool)
    if valid is not None:
        seen[1:] &= valid[: max(shape[0] - 1, 0)].astype(bool)
    return seen


def _colors(colors: Array, count: int, name: str) -> Array:
    """Of the first frame, where there is one row per frame; 0..1 or 0..255."""
    first = colors[0] if colors.ndim == 3 and len(colors) else colors
    if first.shape != (count, 3):
        raise InputError(f"{name}: object_colors: expected shape [T, {count}, 3], found {list(colors.shape)}")
    scale = 255.0 if first.dtype.kind == "f" and np.nanmax(first, initial=0.0) <= 1.0 else 1.0
    return np.clip(np.nan_to_num(first.astype(np.float64)) * scale, 0, 255).round().astype(np.uint8)
