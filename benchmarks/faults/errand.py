"""A kind of job that takes as long as it is told and goes wrong as it is told: what faults are tried on."""

import ctypes
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import BaseModel, ConfigDict

from model.errors import InputError
from worker.kinds import Input, Kind, Outcome, Postponed, Run
from worker.kinds.base import GIBIBYTE

Trouble = Literal[
    "", "bad-input", "exception", "exit", "segfault", "memory", "slow", "stuck", "children", "later"
]


LINGER = ("sleep", "600")


class ErrandOptions(BaseModel):
    """What an errand is told."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seconds: float = 0.1
    bytes: int = 1000
    trouble: Trouble = ""
    attempts: int = 100
    """The trouble comes in the first so many attempts."""
    company: bool = False
    """Whether it starts a process that would outlive it, and a temporary file that would, too."""


class ErrandKind(Kind):
    """A file of so many bytes, after so many seconds."""

    name: ClassVar[str] = "errand"
    queue: ClassVar[str] = "twins"
    options: ClassVar[type[BaseModel]] = ErrandOptions
    inputs: ClassVar[Mapping[str, Input]] = {"note": Input("camera")}
    memory_bytes: ClassVar[int] = GIBIBYTE

    def __init__(self, limit_s: float) -> None:
        """As long as one may take [s]."""
        self.limit_s = limit_s

    def run(self, run: Run) -> Outcome:
        """Run it."""
        options = ErrandOptions.model_validate(run.record.options)
        run.log(f"attempt {run.attempt}")
        run.report("walking", 0.0)
        if options.trouble and run.attempt <= options.attempts:
            meet(options.trouble, run)
        if options.company:
            os.close(tempfile.mkstemp()[0])
            subprocess.Popen(LINGER)
        for step in range(10):
            time.sleep(options.seconds / 10)
            run.report("walking" if step < 5 else "returning", step / 10)
        result = run.folder / "result.bin"
        result.write_bytes(os.urandom(options.bytes))
        notes = {name: len(path.read_bytes()) for name, path in run.inputs.items()}
        return Outcome((result,), {"attempt": run.attempt, "notes": notes.get("note", 0)})


def meet(trouble: Trouble, run: Run) -> None:
    """Go wrong."""
    match trouble:
        case "bad-input":
            raise InputError(f"{run.folder}/input/note: is no note")
        case "exception":
            raise RuntimeError("a fault of ours, at /some/secret/path")
        case "exit":
            os._exit(3)
        case "segfault":
            ctypes.string_at(0)
        case "memory":
            bytearray(2 * GIBIBYTE)
        case "slow":
            time.sleep(60)
        case "stuck":  # in native code that signals do not reach
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
            time.sleep(60)
        case "children":
            subprocess.Popen(LINGER)
            os._exit(3)
        case "later":
            raise Postponed(0.5)
