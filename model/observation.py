"""The observation as a file (contract 3): what really moved, read within limits, refused in one line.

What contradicts the contract is refused (`InputError`). What is within it and yet makes any conclusion
doubtful is a warning.
"""

import warnings
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float64

from model.errors import InputError
from model.formats.files import replacing
from model.formats.npz import read_arrays
from model.observation_doubts import object_size, observation_doubts
from model.types import STANDARD_GRAVITY, Array, Observation

NAMES = tuple(each.name for each in fields(Observation))
REQUIRED = ("times", "points", "controllers")
SIZES = (1e-3, 10.0)
"""What an object may measure [m]; outside, the file is in another unit."""
MAX_GRAVITY = 100.0
"""[m/s²]; above, it is in another unit."""
MAX_STEP = 5.0
"""Between frames [s]; above, times are in another unit."""


def read_observation(path: Path) -> Observation:
    """Read an observation; each doubt about it becomes a warning.

    Keys that the contract does not know are ignored. A point with one coordinate missing is not seen.

    Args:
        path: A `.npz` file.

    Raises:
        InputError: the file breaks the contract; the line names the key, the expected and the found.
    """
    observation = parse_observation(read_arrays(path, NAMES), path.name)
    for doubt in observation_doubts(observation):
        warnings.warn(f"{path.name}: {doubt}", stacklevel=2)
    return observation


def write_observation(path: Path, observation: Observation) -> None:
    """Write a `.npz`; equal observations give equal bytes, and nobody sees half of one.

    Raises:
        InputError: nothing can be written at `path`.
    """
    kept = _arrays(observation)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **kept)


def parse_observation(arrays: Mapping[str, Array], name: str) -> Observation:
    """Make an observation of arrays, in the types of the contract.

    Args:
        arrays: By key.
        name: What messages call the source.

    Raises:
        InputError: the arrays break the contract.
    """
    arrays = {key: np.asarray(value) for key, value in arrays.items()}  # a scalar of numpy is no array
    for key in REQUIRED:
        if key not in arrays:
            raise InputError(f"{name}: {key}: expected {SHAPES[key]}, found no such key")
    times = _times(arrays["times"], name)
    points = _points(arrays["points"], len(times), name)
    controllers = _controllers(arrays["controllers"], points, name)
    return Observation(
        times=times,
        points=points,
        controllers=controllers,
        ground_height=_ground(arrays.get("ground_height"), name),
        gravity=_gravity(arrays.get("gravity"), name),
        colors=_per_point(arrays, "colors", (points.shape[1], 3), np.uint8, name),
        parts=_per_point(arrays, "parts", (points.shape[1],), np.int64, name),
    )


def checked(observation: Observation, name: str) -> Observation:
    """An observation that keeps the contract, as one that was read does.

    Raises:
        InputError: it does not, as where a tracker has lost everything; `name` is its source.
    """
    return parse_observation(_arrays(observation), name)


def _arrays(observation: Observation) -> dict[str, Array]:
    values = {name: getattr(observation, name) for name in NAMES}
    return {name: np.asarray(value) for name, value in values.items() if value is not None}


SHAPES = {
    "times": "[T] seconds, strictly increasing",
    "points": "[T, N, 3] metres, NaN where not seen",
    "controllers": "[T, C, 3] metres (C = 0 where nothing is held)",
}


def _times(times: Array, name: str) -> Float64[Array, " T"]:
    _expect(times.ndim == 1, name, "times", SHAPES["times"], f"shape {list(times.shape)}")
    _expect(len(times) >= 2, name, "times", "at least 2 frames", f"{len(times)}")
    times = times.astype(np.float64)
    _expect(bool(np.isfinite(times).all()), name, "times", "finite seconds", "NaN or infinity")
    steps = np.diff(times)
    if (steps <= 0.0).any():
        frame = int(np.argmin(steps > 0.0))
        found = f"{times[frame]:g} then {times[frame + 1]:g} at frame {frame + 1}"
        raise InputError(f"{name}: times: expected strictly increasing seconds, found {found}")
    median = float(np.median(steps))
    _expect(median <= MAX_STEP, name, "times", "seconds", f"{median:.3g} between frames: milliseconds?")
    return times


def _points(points: Array, frames: int, name: str) -> Array:
    fits = points.ndim == 3 and points.shape[0] == frames and points.shape[2] == 3 and points.shape[1] > 0
    _expect(fits, name, "points", f"shape [{frames}, N, 3] with N > 0", f"{list(points.shape)}")
    points = _single(points)
    _expect(not np.isinf(points).any(), name, "points", "metres, NaN where not seen", "infinity")
    points[np.isnan(points).any(axis=2)] = np.nan
    seen = ~np.isnan(points[..., 0])
    _expect(bool(seen.any()), name, "points", "some points seen", "NaN everywhere")
    _expect(
        int(seen.any(axis=1).sum()) >= 2, name, "points", "points seen in 2 frames", "only one such frame"
    )
    size = object_size(points)
    if size is not None:
        allowed = f"an object of {SIZES[0]:g} to {SIZES[1]:g} m"
        hint = "millimetres?" if size > SIZES[1] else "kilometres, or all points the same?"
        _expect(SIZES[0] <= size <= SIZES[1], name, "points", allowed, f"{size:.4g}: {hint}")
    return points


def _controllers(controllers: Array, points: Float[Array, "T N 3"], name: str) -> Array:
    frames = len(points)
    fits = controllers.ndim == 3 and controllers.shape[0] == frames and controllers.shape[2] == 3
    _expect(fits, name, "controllers", f"shape [{frames}, C, 3]", f"{list(controllers.shape)}")
    controllers = _single(controllers)
    if not np.isfinite(controllers).all():
        frame = int(np.argwhere(~np.isfinite(controllers))[0][0])
        _expect(
            False, name, "controllers", "finite metres in all frames", f"NaN or infinity in frame {frame}"
        )
    if controllers.shape[1]:
        middle = np.nanmedian(points.reshape(-1, 3), axis=0)
        away = float(np.abs(controllers - middle).max())
        _expect(
            away <= 10.0 * SIZES[1],
            name,
            "controllers",
            "metres, in the frame of points",
            f"{away:.4g} m away",
        )
    return controllers


def _ground(height: Array | None, name: str) -> float | None:
    if height is None:
        return None
    _expect(height.size == 1, name, "ground_height", "one number", f"shape {list(height.shape)}")
    value = float(height.reshape(()))
    _expect(not np.isinf(value), name, "ground_height", "metres, or NaN for no ground", "infinity")
    return None if np.isnan(value) else value


def _gravity(gravity: Array | None, name: str) -> tuple[float, float, float]:
    if gravity is None:
        return STANDARD_GRAVITY
    _expect(gravity.shape == (3,), name, "gravity", "shape [3]", f"{list(gravity.shape)}")
    x, y, z = (float(value) for value in gravity)
    size = float(np.linalg.norm([x, y, z]))
    allowed = f"m/s², at most {MAX_GRAVITY:g}"
    _expect(bool(size <= MAX_GRAVITY), name, "gravity", allowed, f"{size:.4g}")  # NaN is not
    return x, y, z


def _per_point(
    arrays: Mapping[str, Array], key: str, shape: tuple[int, ...], kind: type[np.integer], name: str
) -> Array | None:
    if key not in arrays:
        return None
    values = arrays[key]
    _expect(values.shape == shape, name, key, f"shape {list(shape)}", f"{list(values.shape)}")
    limits = np.iinfo(kind)
    numbers = f"{np.dtype(kind).name} numbers"
    _expect(values.dtype.kind in "iu", name, key, numbers, f"{values.dtype}")
    low, high = int(values.min()), int(values.max())
    _expect(low >= limits.min and high <= limits.max, name, key, numbers, f"{low} to {high}")
    return values.astype(kind)


def _single(values: Array) -> Array:
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def _expect(holds: bool, name: str, key: str, expected: str, found: str) -> None:
    if not holds:
        raise InputError(f"{name}: {key}: expected {expected}, found {found}")
