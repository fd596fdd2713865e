"""Cases as files: one archive each, NumPy arrays and one JSON text, and an index with checksums.

A case is a zip archive `NAME.case.npz`: arrays as `numpy.savez` writes them (`np.load` reads them) and
`case.json` with everything that is no array. Its bytes depend on the case alone. A folder of cases has an
`index.json` that names every file, with the sha256 of its bytes.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from model.errors import InputError
from model.formats.archive import MEBIBYTE, read_archive, write_archive
from model.formats.files import replacing
from model.formats.npz import read_arrays
from model.scenes.case import Case, Interaction, ObjectClass
from model.scenes.case_archive import CaseText, Strict, array_names, assemble, case_arrays, case_text
from model.types import Array
from model.version import __version__

SUFFIX = ".case.npz"
INDEX = "index.json"
INDEX_SCHEMA = "matphys.cases/1"
TEXT_LIMIT = 4 * MEBIBYTE


class IndexEntry(Strict):
    """One file of a folder of cases."""

    file: str = Field(pattern=r"^[^/\\]+$")
    sha256: str
    object_name: str
    object_class: ObjectClass
    interaction: Interaction


class CaseIndex(Strict):
    """What `index.json` holds."""

    schema_: str = Field(alias="schema", pattern=f"^{INDEX_SCHEMA}$")
    version: str
    seed: int | None
    cases: list[IndexEntry]


def save_case(case: Case, path: Path) -> None:
    """Write a case; equal cases give equal bytes, and nobody sees half of one.

    Raises:
        InputError: nothing can be written at `path`.
    """
    members = {"case.json": _json(case_text(case))}
    members |= {f"{name}.npy": _npy(value) for name, value in case_arrays(case).items()}
    with replacing(path) as temporary:
        write_archive(temporary, members)


def load_case(path: Path) -> Case:
    """Read a case; no code of the file is ever run.

    Raises:
        InputError: not a case, damaged, or its arrays do not fit each other.
    """
    members = read_archive(path, {"case.json": TEXT_LIMIT})
    if "case.json" not in members:
        raise InputError(f"{path.name}: expected a case with a member case.json, found none")
    try:
        text = CaseText.model_validate_json(members["case.json"])
    except ValidationError as error:
        raise InputError(f"{path.name}: case.json: {_first(error)}") from None
    return assemble(text, read_arrays(path, array_names()), path.name)


def check_no_cases(folder: Path) -> None:
    """Refuse a folder that has cases: an index is of those of one making.

    Raises:
        InputError: it has.
    """
    if folder.exists() and any(folder.glob(f"*{SUFFIX}")):
        raise InputError(f"{folder}: has cases already: give an empty folder")


def write_index(folder: Path, seed: int | None = None) -> CaseIndex:
    """Index every case of a folder, in the order of their names.

    Args:
        folder: Where the cases are.
        seed: That generated them, if they were generated.

    Raises:
        InputError: a case cannot be read, or nothing can be written there.
    """
    entries = []
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        text = CaseText.model_validate_json(read_archive(path, {"case.json": TEXT_LIMIT})["case.json"])
        entries.append(
            IndexEntry(
                file=path.name,
                sha256=_digest(path),
                object_name=text.object_name,
                object_class=text.object_class,
                interaction=text.interaction,
            )
        )
    index = CaseIndex(schema=INDEX_SCHEMA, version=__version__, seed=seed, cases=entries)
    with replacing(folder / INDEX) as temporary:
        temporary.write_bytes(_json(index.model_dump(by_alias=True)))
    return index


def read_index(folder: Path, verify: bool = True) -> list[Path]:
    """The files that the index of a folder names, in its order.

    Args:
        folder: Where cases and index are.
        verify: Also check the sha256 of every file.

    Raises:
        InputError: no index, not an index, or a file is missing or not the one that was indexed.
    """
    index = describe(folder)
    paths = [folder / entry.file for entry in index.cases]
    for path, entry in zip(paths, index.cases, strict=True):
        if not path.is_file():
            raise InputError(f"{folder / INDEX}: {entry.file} is missing: generate the folder again")
        if verify and _digest(path) != entry.sha256:
            raise InputError(f"{path}: its bytes are not those in {INDEX}: generate the folder again")
    return paths


def describe(folder: Path) -> CaseIndex:
    """The index of a folder of cases.

    Raises:
        InputError: no index or not an index.
    """
    path = folder / INDEX
    try:
        return CaseIndex.model_validate_json(path.read_bytes())
    except OSError:
        raise InputError(
            f"{path}: cannot be read: expected a folder that `matphys scenes` has written"
        ) from None
    except ValidationError as error:
        raise InputError(f"{path}: {_first(error)}") from None


def load_folder(folder: Path, verify: bool = True) -> list[Case]:
    """All cases of a folder, in the order of its index.

    Raises:
        InputError: see `read_index` and `load_case`.
    """
    return [load_case(path) for path in read_index(folder, verify)]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _npy(array: Array) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.ascontiguousarray(array) if array.ndim else array, allow_pickle=False)
    return stream.getvalue()


def _json(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False).encode()


def _first(error: ValidationError) -> str:
    one = error.errors()[0]
    return f"{'.'.join(str(step) for step in one['loc']) or 'content'}: {one['msg']}"
