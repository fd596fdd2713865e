"""The process that a job gets for itself, as its worker sees it."""

import contextlib
import ctypes
import faulthandler
import logging
import os
import random
import select
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from worker.guard import Guard
from worker.logs import log_as_json, relay

PR_SET_PDEATHSIG = 1
LIBC = ctypes.CDLL(None)
FAULT = 70


class Horse:
    """A forked process, the leader of its own process group; it ends with its worker, and so does its group.

    Args:
        work: What it does; gives its exit code.
        guard: Ends the group when the worker is gone or the time is over.
        limit_s: That time [s].
        worker: For the logs.
        job: For the logs.
        attempt: For the logs.
    """

    def __init__(
        self, work: Callable[[], int], guard: Guard, limit_s: float, *, worker: str, job: str, attempt: int
    ) -> None:
        """Fork it."""
        self._guard = guard
        reading, writing = os.pipe()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            _live(work, guard, parent, writing, (worker, job, attempt))
        os.close(writing)
        with contextlib.suppress(PermissionError, ProcessLookupError):
            os.setpgid(self.pid, self.pid)  # here too: whichever of us is first
        guard.watch(self.pid, limit_s)
        self._ended = os.pidfd_open(self.pid)
        self._listener = threading.Thread(target=_listen, args=(reading, job, attempt), daemon=True)
        self._listener.start()

    def wait(self, seconds: float) -> int | None:
        """Wait so long for its end; gives the exit code, negative for a signal, or None: it still runs."""
        if not select.select([self._ended], [], [], seconds)[0]:
            return None
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        self.stop()  # what it started and did not wait for
        self._guard.release()
        os.close(self._ended)
        self._listener.join(timeout=1.0)
        return code

    def kill_within(self, seconds: float) -> None:
        """Give it so long to end by itself [s]."""
        self._guard.watch(self.pid, seconds)

    def stop(self) -> None:
        """End it now, with all that it started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)


def end_with(parent: int) -> None:
    """Have the kernel kill this process when the one that forked it ends."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it ended before we could ask
        os._exit(FAULT)


def _live(
    work: Callable[[], int], guard: Guard, parent: int, writing: int, who: tuple[str, str, int]
) -> NoReturn:
    """The life of a horse: nothing of it may reach the code of the worker it was forked from."""
    code = FAULT
    try:
        end_with(parent)
        os.setpgid(0, 0)
        # A service manager may send SIGTERM to every process; whether a job ends is for its worker to say.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        guard.leave()
        for descriptor in (1, 2):
            os.dup2(writing, descriptor)
        os.close(writing)
        log_as_json(*who)
        faulthandler.enable(2)
        _first_to_go()
        random.seed()
        code = work()
    except BaseException:
        logging.getLogger("matphys.job").exception("the job crashed")
    finally:
        os._exit(code)


def _first_to_go() -> None:
    """When the machine runs out of memory, the kernel takes this process before any other."""
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000")


def _listen(reading: int, job: str, attempt: int) -> None:
    with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            relay(line, job, attempt)
