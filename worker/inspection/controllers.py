"""A first look at the motion a user brings: finite positions over time."""

from pathlib import Path

import numpy as np

from model.formats.npz import read_arrays
from model.types import Array
from worker.inspection.verdict import BrokenFileError, UnknownFormatError

NAMES = ("controllers", "controls")


def inspect(path: Path) -> str:
    """Look at a `.npz` with `controllers` (or `controls`) [T, C, 3] and perhaps `times` [T].

    Returns its suffix.

    Raises:
        UnknownFormatError: no zip archive.
        InputError: the archive is damaged, too large, or holds a pickle.
        BrokenFileError: an array is missing, is no array of numbers, or holds what is not finite.
    """
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            raise UnknownFormatError("not a NPZ file: send what numpy.savez writes")
    arrays = read_arrays(path, (*NAMES, "times"))
    name = next((name for name in NAMES if name in arrays), None)
    if name is None:
        raise BrokenFileError("controllers is missing: expected an array [T, C, 3] in metres")
    motion, times = arrays[name], arrays.get("times")
    if motion.ndim != 3 or motion.shape[2] != 3 or not len(motion):
        raise BrokenFileError(f"{name}: expected shape [T, C, 3], found {list(motion.shape)}")
    if not np.isfinite(motion).all():
        raise BrokenFileError(f"{name}: expected finite numbers, found NaN or infinity")
    if times is not None and (times.shape != (len(motion),) or not _increasing(times)):
        raise BrokenFileError(f"times: expected {len(motion)} finite, strictly increasing seconds")
    return ".npz"


def _increasing(times: Array) -> bool:
    seconds = times.astype(np.float64)
    return bool(np.isfinite(seconds).all() and (np.diff(seconds) > 0).all())
