"""Exports of several files: a folder."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import InputError
from model.formats.files import replacing


def write_folder(out: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write files into the folder `out`, which is made; each is whole or not there.

    Other files there stay: an export can be repeated into the folder of the one before.

    Args:
        out: The folder.
        files: Content by path inside of it.

    Raises:
        InputError: `out` is a file, or nothing can be written there.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"cannot write {out}: it is a file, and this format is a folder: give another name")
    written = []
    for name, content in files.items():
        with replacing(out / name) as temporary:
            temporary.write_bytes(content)
        written.append(out / name)
    return written


def npz_bytes(arrays: Mapping[str, Any]) -> bytes:
    """A `.npz`, the same for the same arrays."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()
