"""A process that outlives its worker by a moment, to end what the worker leaves behind.

The kernel ends the horse when its worker is killed (PR_SET_PDEATHSIG), but not what the horse started,
such as a compiler. The guard ends the whole process group: when the worker is gone, and when a job is over
its time, however deep in native code it is.
"""

import contextlib
import os
import select
import signal
import time
from typing import NoReturn


class Guard:
    """Watches one process group at a time for the process that made it."""

    def __init__(self) -> None:
        """Start it; make it before anything else is opened."""
        self._start()

    def watch(self, group: int, seconds: float) -> None:
        """Kill the process group in so many seconds, or when this process ends; replaces what was watched."""
        self._tell(f"{group} {seconds}\n")

    def release(self) -> None:
        """There is nothing to kill any more."""
        self._tell("0 0\n")

    def leave(self) -> None:
        """In a forked child: let the pipe go, so that the guard sees the end of the worker."""
        os.close(self._pipe)

    def close(self) -> None:
        """End the guard, and what it watches."""
        os.close(self._pipe)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self._pid, 0)

    def _start(self) -> None:
        reading, self._pipe = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            _watch(reading)
        os.close(reading)

    def _tell(self, line: str) -> None:
        try:
            os.write(self._pipe, line.encode())
        except BrokenPipeError:  # somebody killed it
            self.close()
            self._start()
            os.write(self._pipe, line.encode())


def _watch(reading: int) -> NoReturn:
    """The life of a guard."""
    try:
        _wait_and_kill(reading)
    finally:
        os._exit(0)


def _wait_and_kill(reading: int) -> None:
    os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.closerange(3, reading)
    os.closerange(reading + 1, os.sysconf("SC_OPEN_MAX"))
    group, deadline = 0, 0.0
    while True:
        rest = max(0.0, deadline - time.monotonic()) if group else None
        if not select.select([reading], [], [], rest)[0]:
            _kill(group)
            deadline = time.monotonic() + 1.0
            continue
        told = os.read(reading, 65536)
        if not told:
            _kill(group)
            return
        words = told.split(b"\n")[-2].split()
        group, deadline = int(words[0]), time.monotonic() + float(words[1])


def _kill(group: int) -> None:
    if group:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(group, signal.SIGKILL)
