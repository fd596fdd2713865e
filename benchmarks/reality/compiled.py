"""C++ engines as libraries, compiled once per text and machine."""

import ctypes
import hashlib
import os
import platform
import re
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.reality.world import Array

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
Numbers = Mapping[str, float | tuple[float, ...]]


class Engine:
    """A C++ text whose functions take a pointer to its `struct Problem`."""

    def __init__(self, text: str) -> None:
        """The engine in the file of this name beside this one; it is compiled when it is first needed."""
        self.path = Path(__file__).with_name(text)
        self._text = self.path.read_text()
        members = _members(self._text)
        fields = [(name, kind) for name, kind, _ in members]
        self._kinds = dict(fields)
        self._integers = {name for name, _, word in members if word == "int32_t"}
        self._problem = type("Problem", (ctypes.Structure,), {"_fields_": fields})

    @cached_property
    def library(self) -> ctypes.CDLL:
        """Its functions."""
        told = "\0".join((self._text, *FLAGS, platform.processor(), platform.node()))
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "matphys" / "reality"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{hashlib.sha256(told.encode()).hexdigest()[:24]}.so"
        if not path.exists():
            with tempfile.TemporaryDirectory(dir=folder) as work:
                made = Path(work) / "engine.so"
                command = [os.environ.get("CXX", "c++"), *FLAGS, str(self.path), "-o", str(made)]
                subprocess.run(command, check=True)
                os.replace(made, path)
        library = ctypes.CDLL(str(path))
        library.problem_bytes.restype = ctypes.c_int64
        if library.problem_bytes() != ctypes.sizeof(self._problem):
            raise RuntimeError(f"{self.path.name} and its reader disagree on Problem")
        return library

    def problem(self, arrays: Mapping[str, Array], numbers: Numbers) -> ctypes.Structure:
        """A `Problem`; what is not given is zero, or absent.

        Arrays of the engine's own type are shared with it, so that it can write into them.
        """
        problem = self._problem()
        kept = []
        for name, value in arrays.items():
            kind = np.int32 if name in self._integers else np.float64
            shared = value.dtype == kind and value.flags.c_contiguous
            kept.append(value if shared else np.ascontiguousarray(value, kind))
            setattr(problem, name, kept[-1].ctypes.data)
        for name, number in numbers.items():
            setattr(problem, name, self._kinds[name](*number) if isinstance(number, tuple) else number)
        problem.kept = kept  # as long as the problem lives, so do its arrays
        return problem


def _members(text: str) -> list[tuple[str, type, str]]:
    """The members of `Problem`, read from the C++ text, so that both sides cannot differ."""
    body = text[text.index("struct Problem {") : text.index("\n};")].split("{", 1)[1]
    body = re.sub(r"//[^\n]*", "", body)
    members: list[tuple[str, type, str]] = []
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
            members.append((plain, kind * int(size) if size else kind, words[0]))
    return members
