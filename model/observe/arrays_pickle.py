"""A pickle read as what it must be: a dictionary of numeric arrays, and nothing that could run code."""

import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import InputError
from model.types import Array

SIZE_LIMIT = 2 << 30
"""[bytes]"""


def read_pickled_arrays(path: Path) -> dict[str, Array]:
    """Read a pickled dictionary of arrays; entries that are not arrays are left out.

    Only what numpy writes for arrays of numbers is rebuilt; any other global, so any code, is refused.

    Raises:
        InputError: no such file, too large, damaged, or a pickle of something else.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size > SIZE_LIMIT:
        raise InputError(f"{path.name}: expected at most {SIZE_LIMIT >> 30} GiB, found more")
    with path.open("rb") as file:
        return parse_pickled_arrays(file.read(), path.name)


def parse_pickled_arrays(data: bytes, name: str) -> dict[str, Array]:
    """The same, of bytes; `name` is what messages call them.

    Raises:
        InputError: damaged, or a pickle of something else.
    """
    try:
        content = _Arrays(io.BytesIO(data)).load()
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except Exception as error:  # a damaged pickle can raise anything
        raise InputError(f"{name}: expected a whole pickle, found a damaged one ({error})") from None
    if not isinstance(content, dict):
        raise InputError(f"{name}: expected a dictionary of arrays, found {type(content).__name__}")
    return {key: value for key, value in content.items() if isinstance(key, str) and _is_numeric(value)}


def _is_numeric(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf"


class _ArrayType:
    """Stands for `numpy.ndarray`, which pickles name but need not call."""


def _empty(kind: type, shape: tuple[int, ...], code: bytes) -> Array:
    """What numpy's pickles begin an array with; its content follows as state."""
    if kind is not _ArrayType or shape != (0,):
        raise InputError("expected arrays as numpy writes them, found another construction")
    return np.ndarray((0,), np.dtype("b"))


def _plain_dtype(code: str, *flags: object) -> np.dtype[Any]:
    kind = np.dtype(code)
    if kind.kind not in "biuf":
        raise InputError(f"expected numbers, found {kind}")
    return kind


def _from_buffer(buffer: bytes | bytearray, kind: np.dtype[Any], shape: tuple[int, ...], order: str) -> Array:
    return np.frombuffer(buffer, kind).reshape(shape, order="F" if order == "F" else "C")


def _scalar(kind: np.dtype[Any], data: bytes) -> np.generic:
    value: np.generic = np.frombuffer(data, kind)[0]
    return value


def _encode(text: str, encoding: str) -> bytes:
    """How old protocols write bytes."""
    if encoding != "latin1":
        raise InputError(f"expected bytes in latin1, found {encoding}")
    return text.encode("latin1")


KNOWN: dict[tuple[str, str], Callable[..., object] | type] = {
    ("numpy", "ndarray"): _ArrayType,
    ("numpy", "dtype"): _plain_dtype,
    ("_codecs", "encode"): _encode,
    **{(f"numpy.{core}.multiarray", "_reconstruct"): _empty for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): _scalar for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): _from_buffer for core in ("core", "_core")},
}
"""Every global that a pickle may name."""


class _Arrays(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        if (module, name) not in KNOWN:
            raise InputError(f"expected arrays only, found the global {module}.{name}: refused")
        return KNOWN[module, name]

    def persistent_load(self, identity: object) -> Any:  # noqa: ANN401
        raise InputError("expected arrays only, found a persistent identity: refused")
