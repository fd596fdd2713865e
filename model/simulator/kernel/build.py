"""C++ text to a library in memory, through the system's compiler and a cache on disk."""

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

FLAGS = (
    "-std=c++17",
    "-O3",
    "-march=native",
    "-fschedule-insns",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fPIC",
    "-shared",
)
"""Not -ffast-math: what is not finite has to stay so, to be found."""
WISHES = (("-fopenmp", "#include <omp.h>\n"), ("-fsched-pressure", ""))
"""Flags for compilers that know them, and what has to compile with each; the engine does without them too."""
SECONDS = 120
"""After which a compiler that does not answer is given up."""


class CannotBuild(Exception):
    """There is no compiler, or it refuses; says why in one line."""


@lru_cache(maxsize=64)
def load(source: str) -> ctypes.CDLL:
    """The library of a C++ text, compiled once per machine.

    Raises:
        CannotBuild: no compiler, or one that refuses the text.
    """
    compiler = _compiler()
    flags = (*FLAGS, *_wishes(compiler))
    told = "\0".join([source, *compiler[1:], *flags, _version(compiler), _processor()])
    name = f"{hashlib.sha256(told.encode()).hexdigest()}.so"
    folder = cache_folder()
    path = folder / name
    if not path.exists():
        _compile(compiler, flags, source, path)
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise CannotBuild(f"the compiled kernel {path} does not load ({error}): delete it") from error


def cache_folder() -> Path:
    """Where compiled kernels stay; a temporary folder where there is no writable home."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "matphys" / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return _temporary_folder()


@lru_cache(maxsize=1)
def _temporary_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="matphys-kernels-"))


def _compile(compiler: tuple[str, ...], flags: tuple[str, ...], source: str, path: Path) -> None:
    """Compile beside `path`, then move there: whoever builds the same at once does no harm."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix="build-") as work:
        text, made = Path(work) / "kernel.cpp", Path(work) / "kernel.so"
        text.write_text(source)
        try:
            run = subprocess.run(
                [*compiler, *flags, str(text), "-o", str(made)],
                capture_output=True,
                text=True,
                timeout=SECONDS,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise CannotBuild(f"the compiler {shlex.join(compiler)} does not run ({error})") from error
        if run.returncode:
            said = next((line for line in run.stderr.splitlines() if "error" in line), run.stderr[:200])
            raise CannotBuild(f"the compiler {shlex.join(compiler)} refuses the kernel: {said}")
        os.replace(made, path)


def _compiler() -> tuple[str, ...]:
    """The command and its first arguments: `CXX` may be `ccache g++`."""
    try:
        wanted, *rest = shlex.split(os.environ.get("CXX", "")) or ["c++"]
    except ValueError as error:
        raise CannotBuild(f"CXX is no command ({error})") from None
    found = shutil.which(wanted)
    if found is None:
        raise CannotBuild(f"there is no C++ compiler ({wanted} is not on the PATH)")
    return found, *rest


@lru_cache(maxsize=8)
def _version(compiler: tuple[str, ...]) -> str:
    return subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout


@lru_cache(maxsize=8)
def _wishes(compiler: tuple[str, ...]) -> tuple[str, ...]:
    """Those of `WISHES` that the compiler grants."""

    def granted(flag: str, text: str) -> bool:
        ask = [*compiler, "-Werror", flag, "-x", "c++", "-E", "-"]
        return not subprocess.run(ask, input=text, capture_output=True, text=True, check=False).returncode

    return tuple(flag for flag, text in WISHES if granted(flag, text))


@lru_cache(maxsize=1)
def _processor() -> str:
    """What `-march=native` means here."""
    try:
        lines = Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    kept = ("model name", "flags", "Features", "CPU part", "CPU implementer")
    return "\n".join(line for line in lines if line.startswith(kept))
