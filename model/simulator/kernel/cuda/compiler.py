"""CUDA text to what a device runs, through NVRTC and a cache on disk.

NVRTC is called through ctypes. Every CUDA build of torch brings it along, while what torch itself offers of
it is private (`torch.cuda._compile_kernel`, one kernel at a time); `cuda-python` would be one more package.
"""

import ctypes
import hashlib
import os
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

from model.simulator.kernel.build import CannotBuild, cache_folder

LIBRARIES = ("libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so")
OPTIONS = ("--std=c++17", "--device-as-default-execution-space")
"""The second for lambdas, whose calls NVRTC takes for the host's. Not --use_fast_math: what is not finite has
to stay so, to be found."""


def compile_text(source: str, capability: tuple[int, int]) -> bytes:
    """The kernels of a text for devices of a compute capability, compiled once per machine.

    Machine code where NVRTC knows the device; else PTX for the newest it knows, which the driver translates.

    Raises:
        CannotBuild: no NVRTC, or one that refuses the text or the device.
    """
    library = find()
    target = target_of(library, capability)
    told = "\0".join([source, *OPTIONS, target, version(library)])
    path = cache_folder() / f"{hashlib.sha256(told.encode()).hexdigest()}.{target}"
    if not path.exists():
        image = build(library, source, target)
        handle, made = tempfile.mkstemp(dir=path.parent, prefix="build-")
        with os.fdopen(handle, "wb") as file:
            file.write(image)
        os.replace(made, path)  # so that whoever builds the same at once does no harm
    return path.read_bytes()


@lru_cache(maxsize=1)
def find() -> ctypes.CDLL:
    """NVRTC: the one beside torch, else one that the system finds.

    Raises:
        CannotBuild: there is none.
    """
    beside = [Path(folder) / "nvidia" for folder in sys.path]
    known = [found for folder in beside for found in sorted(folder.glob("*/lib/libnvrtc.so.*"), reverse=True)]
    for name in [*known, *map(Path, LIBRARIES)]:
        try:
            for part in sorted(name.parent.glob("libnvrtc-builtins.so*")):
                ctypes.CDLL(str(part))  # it would look for that on the system's path alone
            return ctypes.CDLL(str(name))
        except OSError:
            continue
    raise CannotBuild("there is no NVRTC (libnvrtc.so): install the package nvidia-cuda-nvrtc")


def version(library: ctypes.CDLL) -> str:
    """Of NVRTC."""
    major, minor = ctypes.c_int(), ctypes.c_int()
    _check(library, library.nvrtcVersion(ctypes.byref(major), ctypes.byref(minor)))
    return f"{major.value}.{minor.value}"


def target_of(library: ctypes.CDLL, capability: tuple[int, int]) -> str:
    """`sm_…` where NVRTC knows the device, else the newest `compute_…` that it can run.

    Raises:
        CannotBuild: the device is older than all that NVRTC knows.
    """
    count = ctypes.c_int()
    _check(library, library.nvrtcGetNumSupportedArchs(ctypes.byref(count)))
    architectures = (ctypes.c_int * count.value)()
    _check(library, library.nvrtcGetSupportedArchs(architectures))
    wanted = 10 * capability[0] + capability[1]
    if wanted in architectures:
        return f"sm_{wanted}"
    older = [known for known in architectures if known < wanted]
    if not older:
        raise CannotBuild(f"NVRTC {version(library)} knows no device as old as sm_{wanted}")
    return f"compute_{max(older)}"


def build(library: ctypes.CDLL, source: str, target: str) -> bytes:
    """Compile a text for a target: `sm_…` makes machine code, `compute_…` PTX.

    Raises:
        CannotBuild: NVRTC refuses; says why in one line.
    """
    program = ctypes.c_void_p()
    made = library.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"kernel.cu", 0, None, None)
    _check(library, made)
    options = [f"--gpu-architecture={target}".encode(), *(option.encode() for option in OPTIONS)]
    try:
        failed = library.nvrtcCompileProgram(
            program, len(options), (ctypes.c_char_p * len(options))(*options)
        )
        if failed:
            said = _text(library, program, "ProgramLog").decode(errors="replace").splitlines()
            why = next((line for line in said if "error" in line), "".join(said[:1]))
            raise CannotBuild(f"NVRTC refuses the kernel: {why}")
        return _text(library, program, "CUBIN" if target.startswith("sm_") else "PTX")
    finally:
        library.nvrtcDestroyProgram(ctypes.byref(program))


def _text(library: ctypes.CDLL, program: ctypes.c_void_p, what: str) -> bytes:
    size = ctypes.c_size_t()
    _check(library, getattr(library, f"nvrtcGet{what}Size")(program, ctypes.byref(size)))
    text = ctypes.create_string_buffer(size.value)
    _check(library, getattr(library, f"nvrtcGet{what}")(program, text))
    return text.raw


def _check(library: ctypes.CDLL, result: int) -> None:
    if result:
        library.nvrtcGetErrorString.restype = ctypes.c_char_p
        raise CannotBuild(f"NVRTC fails: {library.nvrtcGetErrorString(result).decode()}")
