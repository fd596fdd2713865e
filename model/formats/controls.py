"""A motion of the controllers that the user brings (`--controls NPZ`)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64

from model.errors import InputError
from model.formats.npz import read_arrays
from model.types import Array

NAMES = ("controls", "controllers")


@dataclass(frozen=True)
class Controls:
    """Where the controllers are, frame by frame."""

    motion: Float32[Array, "T C 3"]
    """[m]; frame 0 belongs to the rest state."""
    times: Float64[Array, " T"] | None
    """[s], strictly increasing; None: the frame rate of the clip."""


def read_controls(path: Path, controllers: int) -> Controls:
    """Read `controls` (or `controllers`) [T, C, 3] and, if there, `times` [T].

    Args:
        path: A `.npz` file.
        controllers: C, how many controllers the twin has.

    Raises:
        InputError: no such array, of another shape, or not finite.
    """
    arrays = read_arrays(path, (*NAMES, "times"))
    name = next((name for name in NAMES if name in arrays), None)
    if name is None:
        raise InputError(
            f"{path.name}: controls is missing: expected an array [T, {controllers}, 3] in metres"
        )
    motion = arrays[name]
    if motion.ndim != 3 or motion.shape[1:] != (controllers, 3) or not len(motion):
        raise InputError(
            f"{path.name}: {name}: expected shape [T, {controllers}, 3], found {list(motion.shape)}"
        )
    with np.errstate(over="ignore"):
        motion = motion.astype(np.float32)
    if not np.isfinite(motion).all():
        frame = int(np.argwhere(~np.isfinite(motion))[0][0])
        raise InputError(f"{path.name}: {name}[{frame}]: expected finite numbers, found NaN or infinity")
    return Controls(motion, _times(arrays.get("times"), len(motion), path.name))


def _times(times: Array | None, frames: int, name: str) -> Float64[Array, " T"] | None:
    if times is None:
        return None
    if times.shape != (frames,):
        raise InputError(f"{name}: times: expected shape [{frames}], found {list(times.shape)}")
    times = times.astype(np.float64)
    if not np.isfinite(times).all() or not (np.diff(times) > 0).all():
        raise InputError(f"{name}: times: expected finite, strictly increasing seconds")
    return times
