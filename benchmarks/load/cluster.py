"""Several fronts and workers on one Redis and one S3 server (moto's), as real processes on this machine."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from service.auth import SCOPES, ApiKeys
from worker.embedded import EmbeddedRedis
from worker.queues import Queues, connect
from worker.records import Records

NAP = str(Path(__file__).parent / "nap.py")
"""Jobs that only pass time, with a front and a worker that take them."""
BUCKET = "matphys"
START_S = 120.0
STOP_S = 40.0
PLENTY = {
    "MATPHYS_SUBMISSIONS_PER_MINUTE": "1000000",
    "MATPHYS_REQUESTS_PER_MINUTE": "100000000",
    "MATPHYS_MAX_JOBS": "1000000",
    "MATPHYS_MAX_JOBS_PER_TENANT": "1000000",
    "MATPHYS_MIN_FREE_MIB": "64",
}
"""Limits per key out of the way: one key stands for many users here."""


@dataclass(frozen=True)
class Process:
    """One of them, and where it logs."""

    popen: subprocess.Popen[bytes]
    log: Path
    url: str = ""
    started_s: float = 0.0
    """Until it answered [s]."""

    @property
    def memory_mb(self) -> tuple[float, float]:
        """Resident memory now and at most [MB], without short-lived children."""
        lines = Path(f"/proc/{self.popen.pid}/status").read_text().splitlines()
        sizes = {line.split(":")[0]: float(line.split()[1]) / 1000 for line in lines if line.startswith("Vm")}
        return sizes["VmRSS"], sizes["VmHWM"]

    @property
    def cpu_s(self) -> tuple[float, float]:
        """Processor time of the process and of the children it has waited for [s]."""
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text().rpartition(")")[2].split()
        own, theirs = int(fields[11]) + int(fields[12]), int(fields[13]) + int(fields[14])
        tick = os.sysconf("SC_CLK_TCK")
        return own / tick, theirs / tick

    @property
    def maps_torch(self) -> bool:
        """Whether torch is loaded."""
        return "libtorch" in Path(f"/proc/{self.popen.pid}/maps").read_text()


@dataclass(frozen=True)
class Cluster:
    """What runs."""

    redis_url: str
    key: str
    fronts: Sequence[Process]
    workers: Sequence[Process]
    queues: Queues
    records: Records

    def jobs_per_worker(self) -> Sequence[int]:
        """How many jobs each worker has ended, by what they logged."""
        return [len(ended(worker.log)) for worker in self.workers]


def ended(log: Path) -> Counter[str]:
    """Job → how often a worker's log says that it ended."""
    found: Counter[str] = Counter()
    for line in log.read_text().splitlines():
        entry = json.loads(line) if line.startswith("{") else {}
        if "outcome" in entry and "job" in entry:
            found[entry["job"]] += 1
    return found


@contextmanager
def cluster(folder: Path, fronts: int, workers: int, *, naps: bool, s3: bool = True) -> Iterator[Cluster]:
    """Start it, wait until all is ready, and stop it.

    Args:
        folder: For data and logs.
        fronts: How many fronts.
        workers: How many workers.
        naps: Whether jobs only pass time (`nap.py`), or are twins.
        s3: Whether the store is an S3 server; else a folder.
    """
    with ExitStack() as stack:
        redis = stack.enter_context(EmbeddedRedis(folder / "redis"))
        environment = {**os.environ, **PLENTY, "OMP_NUM_THREADS": "1", "REDIS_URL": redis.url}
        environment |= stack.enter_context(_s3(folder)) if s3 else {"STORE_URL": f"file://{folder}/store"}
        client = stack.enter_context(connect(redis.url))
        records = Records(client)
        queues = Queues(client, records)
        key = ApiKeys(client).create("load", "load", SCOPES)[1]
        serving = [stack.enter_context(_front(folder, number, environment, naps)) for number in range(fronts)]
        running = [
            stack.enter_context(_worker(folder, number, environment, naps)) for number in range(workers)
        ]
        _wait(lambda: len(queues.workers()) == workers, "the workers", running)
        yield Cluster(redis.url, key, serving, running, queues, records)


@contextmanager
def _s3(folder: Path) -> Iterator[dict[str, str]]:
    """Moto's server with a bucket; gives what fronts and workers have to know."""
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    with _process(command, folder / "s3.log", dict(os.environ)) as process:
        _wait(lambda: _answers(f"{url}/moto-api/"), "the S3 server", [process])
        httpx.put(f"{url}/{BUCKET}").raise_for_status()
        yield {
            "STORE_URL": f"s3://{BUCKET}/jobs",
            "AWS_ENDPOINT_URL": url,
            "AWS_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
        }


@contextmanager
def _front(folder: Path, number: int, environment: dict[str, str], naps: bool) -> Iterator[Process]:
    port = free_port()
    url, data = f"http://127.0.0.1:{port}", str(folder / f"front-{number}")
    if naps:
        command = [NAP, "front", data, str(port)]
    else:
        command = ["-m", "service.main", "--port", str(port), "--data-dir", data]
    started = time.monotonic()
    with _process([sys.executable, *command], folder / f"front-{number}.log", environment) as process:
        _wait(lambda: _answers(f"{url}/livez"), "a front", [process])
        yield Process(process.popen, process.log, url, time.monotonic() - started)


@contextmanager
def _worker(folder: Path, number: int, environment: dict[str, str], naps: bool) -> Iterator[Process]:
    scratch = str(folder / "scratch")
    if naps:
        command = [NAP, "worker", scratch]
    else:
        command = ["-m", "worker.main", "--scratch", scratch, "--grace", "1"]
    with _process([sys.executable, *command], folder / f"worker-{number}.log", environment) as process:
        yield process


@contextmanager
def _process(command: list[str], log: Path, environment: dict[str, str]) -> Iterator[Process]:
    with log.open("wb") as out:
        popen = subprocess.Popen(
            command, env=environment, stdout=out, stderr=out, stdin=subprocess.DEVNULL, start_new_session=True
        )
    try:
        yield Process(popen, log)
    finally:
        popen.terminate()
        try:
            popen.wait(STOP_S)
        except subprocess.TimeoutExpired:
            os.killpg(popen.pid, signal.SIGKILL)
            popen.wait()


def _wait(done, what: str, processes: Sequence[Process]) -> None:
    deadline = time.monotonic() + START_S
    while not done():
        for process in processes:
            if process.popen.poll() is not None:
                raise RuntimeError(f"{what} ended: {process.log.read_text()[-2000:]}")
        if time.monotonic() > deadline:
            raise TimeoutError(f"{what} did not start")
        time.sleep(0.02)


def _answers(url: str) -> bool:
    try:
        return httpx.get(url, timeout=2).status_code == 200
    except httpx.TransportError:
        return False


def free_port() -> int:
    """A port nobody listens at."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port
