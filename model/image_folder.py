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
        if file.suffix.lower() in IMAGE_SUFFIXES and (numbers := re.findall(r"\d+", file.stem))
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


def _image_size(file: Path) -> tuple[int, int]:
    """Width and height from the header of a PNG or a JPEG [px]."""
    with file.open("rb") as stream:
        head = stream.read(24)
        if head[:8] == b"\x89PNG\r\n\x1a\n" and len(head) == 24:
            width, height = struct.unpack(">II", head[16:24])
            return width, height
        stream.seek(2)
        while head[:2] == b"\xff\xd8" and len(marker := stream.read(4)) == 4 and marker[0] == 0xFF:
            kind, length = marker[1], int.from_bytes(marker[2:], "big")
            if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):  # start of frame
                height, width = struct.unpack(">xHH", stream.read(5))
                return width, height
            stream.seek(length - 2, 1)
    raise InputError(f"{file}: not a PNG or JPEG image")
