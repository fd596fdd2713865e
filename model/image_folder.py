"""A folder of numbered images, read as a clip."""

import re
import struct
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from model.errors import InputError
from model.frame_keeper import FrameKeeper, check_duration, check_size, sha256_of
from model.types import Frames

IMAGE_SUFFIXES: Final = (".png", ".jpg", ".jpeg")
PNG_END: Final = b"IEND\xaeB`\x82"
JPEG_END: Final = b"\xff\xd9"
STARTS_OF_FRAME: Final = tuple(bytes([kind]) for kind in range(0xC0, 0xD0) if kind not in (0xC4, 0xC8, 0xCC))
"""Markers of a JPEG behind which its size stands."""


def read_folder(path: Path, max_frames: int, max_pixels: int, max_seconds: float, fps: float) -> Frames:
    """Read the numbered images of a folder as a clip of `fps` frames per second.

    Raises:
        InputError: the folder holds no such images, or they are damaged, too many or too large.
    """
    if not 0 < fps < np.inf:
        raise InputError(f"{path.name}: --fps {fps:g}: expected a positive number of frames per second")
    numbered = [
        (int(numbers[-1]), file)
        for file in sorted(path.iterdir())
        if _is_image(file) and (numbers := re.findall(r"\d+", file.stem))
    ]
    if not numbered:
        raise InputError(f"{path}: the folder holds no numbered PNG or JPEG images")
    if len({number for number, _ in numbered}) < len(numbered):
        raise InputError(f"{path}: two images of the folder carry the same number")
    files = [file for _, file in sorted(numbered)]
    check_duration(path, len(files) / fps, max_seconds)
    for file in files:
        width, height = _image_size(file)
        check_size(file, width, height, max_pixels)
    keeper = FrameKeeper(max_frames, stride=-(-len(files) // max_frames))
    for index, file in enumerate(files):
        if keeper.wants(index / fps):
            image = cv2.imread(str(file), cv2.IMREAD_COLOR)
            if image is None:
                raise InputError(f"{file}: a damaged image")
            keeper.keep(np.ascontiguousarray(image[:, :, ::-1]), index / fps)
    return keeper.frames(path, sha256_of(files))


def _is_image(file: Path) -> bool:
    """Whether it is named as an image; what other systems leave beside files (`._1.png`) is none."""
    return file.suffix.lower() in IMAGE_SUFFIXES and not file.name.startswith(".") and file.is_file()


def _image_size(file: Path) -> tuple[int, int]:
    """Width and height from the header of a whole PNG or JPEG [px]."""
    data = file.read_bytes()
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        _check_end(file, data, 24, PNG_END)
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    at = 2
    while data.startswith(b"\xff\xd8") and data[at : at + 1] == b"\xff":
        kind, length = data[at + 1 : at + 2], int.from_bytes(data[at + 2 : at + 4], "big")
        if kind in STARTS_OF_FRAME:
            _check_end(file, data, at + 9, JPEG_END)
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        at += 2 + length
    raise InputError(f"{file}: not a PNG or JPEG image")


def _check_end(file: Path, data: bytes, header: int, end: bytes) -> None:
    """Refuse an image that breaks off; a decoder would paint what is missing grey."""
    if data.find(end, header) < 0:
        raise InputError(f"{file}: the image breaks off; copy it again")
