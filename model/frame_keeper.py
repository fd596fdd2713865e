"""Keeping the frames of a clip within bounds: how many, how large, how long."""

import hashlib
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from jaxtyping import UInt8

from model.errors import InputError
from model.types import Array, Frames

WORKING_SIDE: Final = 960
"""Longest side of a decoded frame [px]; larger ones are reduced to it."""


class FrameKeeper:
    """Collects frames up to a count; when there are more, drops every other one and goes on."""

    def __init__(self, limit: int, stride: int) -> None:
        """Keep at most `limit` frames, at first every `stride`-th."""
        self.limit, self.stride, self.seen = limit, max(1, stride), 0
        self.images: list[UInt8[Array, "H W 3"]] = []
        self.times: list[float] = []
        self.numbers: list[int] = []
        self.origin: float | None = None
        self.last: float | None = None
        self.unordered = 0
        self.source_size: tuple[int, int] | None = None

    def start(self, time: float) -> float:
        """The time of the first frame [s]."""
        if self.origin is None:
            self.origin = time
        return self.origin

    def wants(self, time: float) -> bool:
        """Whether the frame shown at `time` [s] is to be kept; counts it either way."""
        if self.last is not None and time <= self.last:
            self.unordered += 1  # a repeated time stamp shows nothing new
            return False
        self.last = time
        self.seen += 1
        return (self.seen - 1) % self.stride == 0

    def keep(self, image: UInt8[Array, "H W 3"], time: float, pixel_aspect: float = 1.0) -> None:
        """Keep an upright frame, reduced to the working size and made of square pixels."""
        shown = (round(image.shape[1] * pixel_aspect), image.shape[0])
        image = working_size(image, pixel_aspect)
        reduced = (image.shape[1], image.shape[0])
        self.source_size = None if reduced == shown else shown
        if len(self.images) == self.limit:
            self.images, self.times, self.numbers = self.images[::2], self.times[::2], self.numbers[::2]
            self.stride *= 2
            if (self.seen - 1) % self.stride:
                return
        self.images.append(image)
        self.times.append(time)
        self.numbers.append(self.seen + self.unordered - 1)

    def frames(self, path: Path, sha256: str) -> Frames:
        """The record of everything kept."""
        if len(self.images) < 2:
            raise InputError(f"{path.name}: {self.seen} frame(s) found; motion needs at least 2")
        if len({image.shape for image in self.images}) > 1:
            raise InputError(f"{path.name}: the frame size changes within the clip; encode it in one size")
        warnings = []
        if self.stride > 1:
            warnings.append(
                f"{self.seen} frames are more than the {self.limit} we keep: "
                f"every {_ordinal(self.stride)} was used"
            )
        if self.unordered:
            warnings.append(f"{self.unordered} frame(s) with a repeated time stamp were dropped")
        times = np.asarray(self.times, np.float64)
        total = self.seen + self.unordered
        whole = len(times) == total
        return Frames(
            np.stack(self.images),
            times - times[0],
            path.name,
            sha256,
            tuple(warnings),
            self.source_size,
            None if whole else np.asarray(self.numbers),
            None if whole else total,
        )


def _ordinal(number: int) -> str:
    return {2: "2nd", 3: "3rd"}.get(number, f"{number}th")


def check_size(path: Path, width: int, height: int, max_pixels: int) -> None:
    """Refuse frames of too many pixels."""
    if width * height > max_pixels:
        raise InputError(
            f"{path.name}: {width}×{height} pixels are more than the {max_pixels / 1e6:.1f} million "
            "we decode; reduce its size first"
        )


def check_duration(path: Path, seconds: float, max_seconds: float) -> None:
    """Refuse a clip that is too long."""
    if seconds > max_seconds + 1e-6:
        raise InputError(
            f"{path.name}: {seconds:.1f} s are longer than the {max_seconds:g} s we take; "
            "cut out the part where the object is handled"
        )


def working_size(image: UInt8[Array, "H W 3"], pixel_aspect: float = 1.0) -> UInt8[Array, "h w 3"]:
    """The image within the working size, its pixels square."""
    height, width = image.shape[:2]
    shown = width * pixel_aspect
    scale = min(1.0, WORKING_SIDE / max(shown, height))
    if scale == 1.0 and pixel_aspect == 1.0:
        return image
    size = tuple(max(2, 2 * round(side * scale / 2)) for side in (shown, height))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def sha256_of(paths: list[Path]) -> str:
    """Of the bytes of all files, one after another, hexadecimal."""
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
