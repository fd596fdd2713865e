"""A first look at a camera file: a small JSON object of finite numbers under the names that are read."""

import json
import math
from pathlib import Path
from typing import Any, Final, NoReturn

from worker.inspection.verdict import BrokenFileError, UnknownFormatError

KEYS: Final = ("intrinsics", "width", "height", "world_from_camera", "ground_height", "gravity")
"""As `model.reconstruction.camera_file` has them."""
MAX_BYTES: Final = 1_000_000


def inspect(path: Path) -> str:
    """Look at a camera file; returns its suffix.

    Raises:
        UnknownFormatError: no JSON.
        BrokenFileError: something else than the object `docs/camera.md` describes.
    """
    if path.stat().st_size > MAX_BYTES:
        raise BrokenFileError(f"more than {MAX_BYTES} bytes: a camera needs a few numbers")
    try:
        entries = json.loads(path.read_bytes(), parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise UnknownFormatError("not a JSON file of finite numbers") from None
    if not isinstance(entries, dict) or "intrinsics" not in entries:
        raise BrokenFileError("intrinsics is missing: expected an object with it")
    unknown = sorted(set(entries) - set(KEYS))
    if unknown:
        raise BrokenFileError(f"{unknown[0][:40]!r} is not known: expected {', '.join(KEYS)}")
    for key, value in entries.items():
        if not _numbers(value, depth=3):
            raise BrokenFileError(f"{key}: expected finite numbers")
    return ".json"


def _numbers(value: Any, depth: int) -> bool:  # noqa: ANN401 - whatever JSON can express
    if isinstance(value, list | dict):
        entries = list(value.values()) if isinstance(value, dict) else value
        return depth > 0 and 0 < len(entries) <= 9 and all(_numbers(each, depth - 1) for each in entries)
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not finite")
