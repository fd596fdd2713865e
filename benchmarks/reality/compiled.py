"""The engine as a library, compiled once per text and machine."""

import ctypes
import hashlib
import os
import platform
import re
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.reality.world import Array

TEXT = Path(__file__).with_name("engine.cpp")
FLAGS = (
    "-std=c++17",
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-Wno-psabi",
    "-fPIC",
    "-shared",
)
KINDS = {"int32_t": ctypes.c_int32, "double": ctypes.c_double}


def _fields() -> list[tuple[str, type]]:
    """The members of `Problem`, read from the C++ text, so that both sides cannot differ."""
    text = TEXT.read_text()
    body = text[text.index("struct Problem {") : text.index("\n};")].split("{", 1)[1]
    body = re.sub(r"//[^\n]*", "", body)
    fields: list[tuple[str, type]] = []
    for statement in body.split(";"):
        words = statement.replace("const ", "").split(None, 1)
        if len(words) < 2:
            continue
        for name in words[1].split(","):
            match = re.fullmatch(r"(\*?)(\w+)(?:\[(\d+)\])?", name.strip())
            if match is None:
                raise ValueError(f"cannot read the member {name!r} of Problem")
            star, plain, size = match.groups()
            kind = ctypes.c_void_p if star else KINDS[words[0]]
            fields.append((plain, kind * int(size) if size else kind))
    return fields


class Problem(ctypes.Structure):
    """As in engine.cpp."""

    _fields_ = _fields()


INTEGERS = ("corner", "stencil", "grip_node", "face")


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    text = TEXT.read_text()
    told = "\0".join((text, *FLAGS, platform.processor(), platform.node()))
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "matphys" / "reality"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{hashlib.sha256(told.encode()).hexdigest()[:24]}.so"
    if not path.exists():
        with tempfile.TemporaryDirectory(dir=folder) as work:
            made = Path(work) / "engine.so"
            command = [os.environ.get("CXX", "c++"), *FLAGS, str(TEXT), "-o", str(made)]
            subprocess.run(command, check=True)
            os.replace(made, path)
    library = ctypes.CDLL(str(path))
    library.problem_bytes.restype = ctypes.c_int64
    if library.problem_bytes() != ctypes.sizeof(Problem):
        raise RuntimeError("engine.cpp and its reader disagree on Problem")
    return library


def simulate(arrays: dict[str, Array], numbers: dict[str, float | tuple[float, ...]]) -> int:
    """Run the engine; results are written into the arrays named `out`, `energy`, `touched`, `met`, `slipped`.

    Returns:
        0, or 1 + the frame in which the motion ran away.
    """
    problem = Problem()
    kept = []
    for name, value in arrays.items():
        kind = np.int32 if name in INTEGERS else np.float64
        plain = (
            value if value.dtype == kind and value.flags.c_contiguous else np.ascontiguousarray(value, kind)
        )
        kept.append(plain)
        setattr(problem, name, plain.ctypes.data)
    for name, number in numbers.items():
        kind = dict(Problem._fields_)[name]
        setattr(problem, name, kind(*number) if isinstance(number, tuple) else number)
    return int(_library().simulate(ctypes.byref(problem)))
