"""Exports of several files: a folder."""

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import InputError
from model.formats.files import replacing

OURS = b"# A MatPhys twin"
"""How the README of any export begins."""


def write_folder(out: Path, files: Mapping[str, bytes], series: str | None = None) -> list[Path]:
    """Write files into the folder `out`, which is made; each is whole or not there.

    Other files there stay: an export can be repeated into the folder of the one before.

    Args:
        out: The folder.
        files: Content by path inside of it, a README among them.
        series: Names of which the export before may have had more, as a regular expression: those go.

    Raises:
        InputError: `out` is a file, nothing can be written there, or what is there is of no export.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"cannot write {out}: it is a file, and this format is a folder: give another name")
    readme = out / "README.md"
    again = readme.is_file()
    if again and not readme.read_bytes().startswith(OURS):
        raise InputError(f"cannot write {readme}: it is of no export: give the name of another folder")
    foreign = [] if again else [out / name for name in files if (out / name).exists()]
    if foreign:
        raise InputError(f"cannot write {foreign[0]}: it is of no export: give the name of another folder")
    written = []
    for name, content in files.items():
        with replacing(out / name) as temporary:
            temporary.write_bytes(content)
        written.append(out / name)
    if again and series is not None:
        for path in out.iterdir():
            if re.fullmatch(series, path.name) and path.name not in files:
                path.unlink()
    return written


def npz_bytes(arrays: Mapping[str, Any]) -> bytes:
    """A `.npz`, the same for the same arrays."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()
