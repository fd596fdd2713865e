"""Reading depth images: 16-bit PNG or NPY in millimetres, one image or a numbered folder."""

import io
import re
from pathlib import Path
from tokenize import TokenError

import cv2
import numpy as np
from jaxtyping import Float64

from model.errors import InputError
from model.types import Array

SUFFIXES = (".png", ".npy")
MAXIMUM_BYTES = 200_000_000
FARTHEST = 20.0
"""Depth beyond this [m] is a wrong unit, not a table-top scene."""


def read_depth(
    path: Path,
    keyframe: int,
    frame_count: int,
    height: int,
    width: int,
    source_size: tuple[int, int] | None = None,
) -> Float64[Array, "H W"]:
    """Depth of the keyframe [m], aligned to the colour image; 0 where nothing was measured.

    Args:
        path: One image (of the keyframe), or a folder with one per frame; the numbers in the names give
            the order (2 before 10).
        keyframe: Which frame of the clip is wanted of a folder.
        frame_count: Frames of the whole clip: a folder must hold as many.
        height: Of the clip's images [px].
        width: Of the clip's images [px].
        source_size: Width and height of the clip itself [px], if its images were made smaller: depth of that
            size is taken too.

    Raises:
        InputError: nothing readable there, another size than the clip, not 16-bit or not millimetres.
    """
    file = _of_folder(path, keyframe, frame_count) if path.is_dir() else path
    depth = _read(file)
    size = source_size or (width, height)
    found = (depth.shape[1], depth.shape[0])
    if found not in (size, (width, height)):
        raise InputError(
            f"{file}: depth of {found[0]}×{found[1]} pixels does not fit the clip's "
            f"{size[0]}×{size[1]}; align it to the colour camera"
        )
    if found != (width, height):
        # The pixel at each one's middle: a mean across an edge would lie in the air between two things.
        rows = ((np.arange(height) + 0.5) * found[1] / height).astype(int)
        columns = ((np.arange(width) + 0.5) * found[0] / width).astype(int)
        depth = depth[np.ix_(rows, columns)]
    metres = np.where(np.isfinite(depth) & (depth > 0), depth, 0.0) / 1000.0
    if not (metres > 0).any():
        raise InputError(f"{file}: no pixel has a depth")
    typical = float(np.median(metres[metres > 0]))
    if not 0.02 < typical < FARTHEST:
        raise InputError(f"{file}: depth must be in millimetres, its median would be {typical:g} m")
    return metres


def _of_folder(path: Path, keyframe: int, frame_count: int) -> Path:
    """The file of one frame, in numeric order of the names."""
    files = [
        file
        for file in path.iterdir()
        if file.suffix.lower() in SUFFIXES and file.is_file() and not file.name.startswith(".")
    ]
    numbered = [(int(found[-1]), file) for file in files if (found := re.findall(r"\d+", file.stem))]
    numbered.sort(key=lambda entry: (entry[0], entry[1].name))
    if len(numbered) != frame_count:
        raise InputError(
            f"{path}: {len(numbered)} numbered depth images (.png, .npy) for {frame_count} frames of the clip"
        )
    return numbered[keyframe][1]


def _read(file: Path) -> Float64[Array, "H W"]:
    """Raw numbers of one depth image."""
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"{file}: depth must be a 16-bit .png or a .npy file in millimetres, or a folder of them"
        )
    try:
        if file.stat().st_size > MAXIMUM_BYTES:
            raise InputError(
                f"{file}: more than {MAXIMUM_BYTES} bytes for one depth image; give one frame per file"
            )
        data = file.read_bytes()
        values = _array(data) if file.suffix.lower() == ".npy" else _decoded(data)
    except OSError as error:
        raise InputError(f"{file}: depth cannot be read ({error.strerror})") from None
    except (ValueError, MemoryError, SyntaxError, TokenError):  # numpy parses the header as Python
        raise InputError(f"{file}: not a readable depth image") from None
    if values.ndim != 2 or values.dtype == np.uint8 or values.dtype.kind not in "uif":
        raise InputError(
            f"{file}: depth must have one channel of 16-bit or float numbers, found {values.dtype} of shape "
            f"{list(values.shape)}"
        )
    return values.astype(np.float64)


def _array(data: bytes) -> Array:
    # np.load would take an archive of arrays, too, whatever its name.
    return np.asarray(np.lib.format.read_array(io.BytesIO(data), allow_pickle=False))


def _decoded(data: bytes) -> Array:
    if not data:
        raise ValueError("empty")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ValueError("not an image") from error
    pixels: object = image
    if pixels is None:
        raise ValueError("not an image")
    return np.asarray(image)
