"""Arrays from a NumPy archive, read within limits and without pickle."""

import io
import math
from collections.abc import Collection
from pathlib import Path

import numpy as np

from model.errors import InputError
from model.formats.archive import MEBIBYTE, read_archive
from model.types import Array

ARRAY_LIMIT = 512 * MEBIBYTE
HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_arrays(path: Path, names: Collection[str]) -> dict[str, Array]:
    """Read those of the named numeric arrays that the archive has.

    Args:
        path: A `.npz` file.
        names: The arrays to look for.

    Raises:
        InputError: not such a file, damaged, too large, or an array that does not hold numbers.
    """
    members = read_archive(path, {f"{name}.npy": ARRAY_LIMIT for name in names})
    return {
        name: _decode(members[f"{name}.npy"], f"{path.name}: {name}")
        for name in names
        if f"{name}.npy" in members
    }


def _decode(data: bytes, where: str) -> Array:
    """Parse one `.npy`, whose header is checked against its size before anything is allocated."""
    stream = io.BytesIO(data)
    other = InputError(f"{where}: expected an array as numpy.savez writes it, found something else")
    try:
        read_header = HEADER_READERS[np.lib.format.read_magic(stream)]
        shape, columns_first, kind = read_header(stream)
    except Exception:  # a header is a text in Python: what is none raises all that Python's parser may
        raise other from None
    if kind.kind not in "biuf":
        raise InputError(f"{where}: expected numbers, found {kind}")
    if math.prod(shape) * kind.itemsize != len(data) - stream.tell():
        raise InputError(f"{where}: expected {math.prod(shape)} numbers, found a file of another length")
    values = np.frombuffer(data, kind, offset=stream.tell())
    try:
        return values.reshape(shape, order="F" if columns_first else "C")
    except (ValueError, TypeError):  # a shape of negative numbers, or of truth values
        raise other from None
