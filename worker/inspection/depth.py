"""A first look at depth: a PNG, or one array of numbers."""

from pathlib import Path
from tokenize import TokenError

import numpy as np

from worker.inspection import image
from worker.inspection.verdict import BrokenFileError, UnknownFormatError


def inspect(path: Path) -> str:
    """Look at a depth image; returns the suffix that suits its content.

    Raises:
        UnknownFormatError: neither a PNG nor a NPY.
        BrokenFileError: broken, too large, or no image of numbers.
    """
    with path.open("rb") as file:
        head = file.read(8)
    if head == image.MAGIC:
        return image.inspect(path)
    if not head.startswith(b"\x93NUMPY"):
        raise UnknownFormatError("neither a PNG nor a NPY file: send depth in millimetres as one of them")
    try:
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError, SyntaxError, TokenError):  # numpy parses the header as Python
        raise BrokenFileError("not a whole array of numbers, as numpy.save writes it") from None
    if values.ndim != 2 or values.dtype.kind not in "uif" or not 0 < values.size <= image.MAX_PIXELS:
        found = f"{values.dtype} of shape {list(values.shape)}"
        raise BrokenFileError(f"expected numbers [height, width], found {found}")
    return ".npy"
