"""The process that looks into uploads: `python -m worker.inspection '[["video", "/path"], …]'`.

Prints one JSON object: `{"suffixes": {…}}`, or `{"refused": …, "unknown_format": …, "detail": …}`.
"""

import ctypes
import importlib
import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Final

from model.errors import InputError
from worker.inspection.verdict import BrokenFileError, UnknownFormatError

ALL_INSPECTIONS: Final = ("video", "image", "depth", "controllers", "camera", "mesh", "observation")
"""A module each."""
LIMITS: Final = {
    resource.RLIMIT_AS: 2 << 30,
    resource.RLIMIT_CPU: 10,
    resource.RLIMIT_FSIZE: 0,
    resource.RLIMIT_NOFILE: 32,
    resource.RLIMIT_CORE: 0,
}
"""Memory [bytes], time [s], and: nothing is written anywhere."""


def main(request: str) -> None:
    """Look at the files of the request and print the verdict."""
    _confine()
    suffixes = {}
    for name, kind, path in json.loads(request):
        if kind not in ALL_INSPECTIONS:
            raise SystemExit(f"no inspection {kind!r}")
        try:
            suffixes[name] = importlib.import_module(f"worker.inspection.{kind}").inspect(Path(path))
        except (UnknownFormatError, BrokenFileError, InputError, MemoryError) as error:
            _print(_refusal(name, error))
            return
    _print({"suffixes": suffixes})


def _refusal(name: str, error: Exception) -> dict[str, object]:
    reason = str(error) or "needs more memory than an upload may"
    detail = reason.removeprefix(f"{name}: ")
    return {"refused": name, "unknown_format": isinstance(error, UnknownFormatError), "detail": detail}


def _confine() -> None:
    """Give up what is not needed; end when the front does."""
    for limit, value in LIMITS.items():
        resource.setrlimit(limit, (value, value))
    if sys.platform == "linux":
        set_parent_death_signal, set_no_new_privileges = 1, 38  # of linux/prctl.h
        libc = ctypes.CDLL(None)
        libc.prctl(set_parent_death_signal, signal.SIGKILL)
        libc.prctl(set_no_new_privileges, 1, 0, 0, 0)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"


def _print(verdict: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(verdict))


if __name__ == "__main__":
    main(sys.argv[1])
