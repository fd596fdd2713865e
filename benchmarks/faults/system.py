"""A small service of real processes that can be killed, on a disk that can be filled."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.auth import SCOPES, ApiKeys
from worker.embedded import EmbeddedRedis
from worker.queues import Queues, connect
from worker.records import Records

HERE = Path(__file__).parent
MARK = "MATPHYS_FAULTS"
"""Environment variable of every process of the system, by which those left over are found."""
RESTART_S = 0.5
"""What a service manager waits before it starts a process again [s]."""


class Child:
    """A process that is started again when it ends, as by a service manager."""

    def __init__(self, command: list[str], environment: dict[str, str], log: Path) -> None:
        """Start it."""
        self._command, self._environment, self._log = command, environment, log
        self._ended: float | None = None
        self._start()

    @property
    def pid(self) -> int:
        """Of the process that runs now."""
        return self._process.pid

    def look_after(self) -> None:
        """Start it again when it has ended."""
        if self._process.poll() is None:
            return
        self._ended = self._ended or time.monotonic()
        if time.monotonic() - self._ended >= RESTART_S:
            self._ended = None
            self._start()

    def signal(self, number: int) -> None:
        """Send it a signal."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def stop(self) -> int:
        """End it for good; gives its exit code."""
        self._process.terminate()
        try:
            return self._process.wait(30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def _start(self) -> None:
        with self._log.open("a") as log:
            self._process = subprocess.Popen(
                self._command, env=self._environment, stderr=log, stdout=log, start_new_session=True
            )


class System:
    """All of it, over one disk.

    Args:
        folder: For everything; everything is removed.
        workers: How many.
        disk_mib: Size of a file system of its own for store, uploads, work in progress and Redis; None: they
            lie in `folder`.
    """

    def __init__(self, folder: Path, workers: int, disk_mib: int | None) -> None:
        """Start everything."""
        self.folder, self.disk, self._mounted = folder, folder / "disk", disk_mib is not None
        self.mark = f"{os.getpid()}-{time.time_ns()}"
        self.disk.mkdir(parents=True)
        if disk_mib is not None:
            mount = ["mount", "-t", "tmpfs", "-o", f"size={disk_mib}m", "tmpfs", str(self.disk)]
            subprocess.run(mount, check=True)
        os.environ[MARK] = self.mark
        self.redis = EmbeddedRedis(self.disk / "redis")
        self.redis.start()
        self.redis_away = False
        self.client = connect(self.redis.url, patience_s=60.0)
        self.records = Records(self.client)
        self.queues = Queues(self.client, self.records)
        self.key = ApiKeys(self.client).create("faults", "faults", SCOPES)[1]
        self.store_url = f"file://{self.disk}/store"
        self.port = free_port()
        self.front = Child(self._front(), self._environment(), folder / "front.log")
        self.workers = [
            Child(self._worker(), self._environment(), folder / f"worker-{number}.log")
            for number in range(workers)
        ]

    @property
    def url(self) -> str:
        """Of the front."""
        return f"http://127.0.0.1:{self.port}"

    def look_after(self) -> None:
        """Start again what has ended. On the main thread: Redis ends with the thread that started it."""
        for child in (self.front, *self.workers):
            child.look_after()
        if not self.redis_away and self.redis.pid is None:
            self.redis.launch()

    def worker_of(self, job_id: str) -> Child | None:
        """The worker that runs a job now."""
        name = str(self.client.hget(f"matphys:job:{job_id}", "worker") or "")
        return next((child for child in self.workers if f"-{child.pid}-" in name), None)

    def horse_of(self, child: Child) -> int | None:
        """The process of the job that a worker runs now: the one child that leads a group but no session."""
        for pid, parent, group, session in processes():
            if parent == child.pid and group == pid and session != pid:
                return pid
        return None

    def stop(self) -> None:
        """Stop everything."""
        for child in self.workers:
            child.signal(signal.SIGTERM)
        for child in (*self.workers, self.front):
            child.stop()
        self.client.close()
        self.redis.stop()

    def left_over(self) -> list[str]:
        """Commands of processes of this system that still live."""
        found = []
        for pid, *_ in processes():
            with contextlib.suppress(OSError):
                marked = f"{MARK}={self.mark}".encode() in Path(f"/proc/{pid}/environ").read_bytes()
                if marked and pid != os.getpid():
                    found.append(Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").strip())
        return found

    def remove(self) -> None:
        """Remove all that it wrote."""
        if self._mounted:
            subprocess.run(["umount", "-l", str(self.disk)], check=False)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _environment(self) -> dict[str, str]:
        plenty = {f"MATPHYS_{name}": "1000000" for name in ("SUBMISSIONS_PER_MINUTE", "REQUESTS_PER_MINUTE")}
        limits = {"MATPHYS_MIN_FREE_MIB": "1", "MATPHYS_MAX_JOBS_PER_TENANT": "100000"}
        return {**os.environ, **plenty, **limits, "OMP_NUM_THREADS": "1"}

    def _front(self) -> list[str]:
        data = str(self.disk / "front")
        return [
            sys.executable,
            str(HERE / "errand_front.py"),
            self.redis.url,
            self.store_url,
            data,
            str(self.port),
        ]

    def _worker(self) -> list[str]:
        scratch = str(self.disk / "scratch")
        return [
            sys.executable,
            str(HERE / "errand_worker.py"),
            self.redis.url,
            self.store_url,
            scratch,
            "1.0",
            "15.0",
            "30.0",
        ]


def free_port() -> int:
    """A port of this machine that nobody listens at."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


def processes() -> Iterator[tuple[int, int, int, int]]:
    """Pid, parent, group and session of everything that runs; not of zombies."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if fields[0] != "Z":
                    yield int(entry.name), int(fields[1]), int(fields[2]), int(fields[3])


@contextmanager
def running(folder: Path, workers: int, disk_mib: int | None) -> Iterator[System]:
    """A system, and afterwards nothing of it."""
    system = System(folder, workers, disk_mib)
    try:
        yield system
    finally:
        system.stop()
        system.remove()
