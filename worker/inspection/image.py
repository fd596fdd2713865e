"""A first look at a mask: one PNG, of a size that can be decoded, and whole."""

import zlib
from pathlib import Path
from typing import Final

from worker.inspection.verdict import BrokenFileError, UnknownFormatError

MAGIC: Final = b"\x89PNG\r\n\x1a\n"
MAX_PIXELS: Final = 64_000_000
"""As `model.prompt` has it."""


def inspect(path: Path) -> str:
    """Look at a PNG without decoding it; returns its suffix.

    Raises:
        UnknownFormatError: no PNG.
        BrokenFileError: broken, cut off, or too large.
    """
    data = path.read_bytes()
    if not data.startswith(MAGIC):
        raise UnknownFormatError("not a PNG image")
    width, height = _size(data)
    if not 0 < width * height <= MAX_PIXELS:
        raise BrokenFileError(f"{width}×{height} pixels: expected an image of the clip's size")
    if b"IDAT" not in _chunks(data):
        raise BrokenFileError("holds no pixels")
    return ".png"


def _size(data: bytes) -> tuple[int, int]:
    if data[12:16] != b"IHDR" or len(data) < 33:
        raise BrokenFileError("its header is broken")
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def _chunks(data: bytes) -> list[bytes]:
    """The names of all chunks, to the end, each with the right checksum."""
    names, at = [], len(MAGIC)
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        end = at + 12 + length
        if end > len(data):
            raise BrokenFileError("breaks off: send the whole file")
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise BrokenFileError("is damaged: a checksum does not fit")
        names.append(data[at + 4 : at + 8])
        at = end
        if names[-1] == b"IEND":
            return names
    raise BrokenFileError("breaks off: send the whole file")
