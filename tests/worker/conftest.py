"""A real Redis, and what is kept in it."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from redis import Redis

from worker.embedded import EmbeddedRedis
from worker.progress import Progress
from worker.queues import Queues, connect
from worker.record import JobRecord, new_id
from worker.records import Records
from worker.storage import Storage

FAULTS = Path(__file__).parents[2] / "benchmarks" / "faults"


@pytest.fixture(scope="session")
def redis_server(tmp_path_factory) -> Iterator[EmbeddedRedis]:
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        yield server


@pytest.fixture
def client(redis_server) -> Iterator[Redis]:
    with connect(redis_server.url) as client:
        client.flushall()
        yield client


@pytest.fixture
def records(client) -> Records:
    return Records(client)


@pytest.fixture
def queues(client, records) -> Queues:
    return Queues(client, records)


@pytest.fixture
def progress(client) -> Progress:
    return Progress(client)


@pytest.fixture
def storage(tmp_path) -> Storage:
    return Storage(f"file://{tmp_path}/store")


@pytest.fixture
def errand() -> Callable[..., JobRecord]:
    """Makes the record of an errand, as a front would."""

    def make(tenant: str = "a", queue: str = "twins", kind: str = "errand", **fields) -> JobRecord:
        return JobRecord(id=new_id(), kind=kind, queue=queue, tenant=tenant, **fields)

    return make


@pytest.fixture
def eventually() -> Callable[..., None]:
    """Waits until something holds."""

    def wait(true: Callable[[], object], seconds: float = 15.0) -> None:
        deadline = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < deadline, "it never came true"
            time.sleep(0.01)

    return wait


@dataclass
class Hands:
    """Starts workers that run errands, and asks for errands."""

    url: str
    folder: Path
    records: Records
    queues: Queues
    errand: Callable[..., JobRecord]
    eventually: Callable[..., None]

    def __post_init__(self) -> None:
        self.workers: list[subprocess.Popen[bytes]] = []
        self.store_url = f"file://{self.folder}/store"
        self.log = self.folder / "worker.log"

    def start(
        self, grace_s: float = 3.0, mercy_s: float = 0.5, limit_s: float = 10.0
    ) -> "subprocess.Popen[bytes]":
        script, scratch = FAULTS / "errand_worker.py", self.folder / "scratch"
        limits = [str(each) for each in (grace_s, mercy_s, limit_s)]
        command = [sys.executable, str(script), self.url, self.store_url, str(scratch), *limits]
        with self.log.open("a") as log:
            environment = {**os.environ, "TEST_HANDS": str(self.folder)}
            self.workers.append(subprocess.Popen(command, stderr=log, env=environment))
        return self.workers[-1]

    def ask(self, webhook: str | None = None, inputs: dict[str, str] | None = None, **options) -> str:
        record = self.errand(options=options, webhook=webhook, inputs=inputs or {})
        self.queues.enqueue(self.records.create(record)[0])
        return record.id

    def ended(self, job_id: str, seconds: float = 20.0) -> JobRecord:
        self.eventually(lambda: (record := self.records.get(job_id)) is None or record.final, seconds)
        record = self.records.get(job_id)
        assert record is not None
        return record

    def at_work(self, job_id: str) -> JobRecord:
        self.eventually(
            lambda: (record := self.records.get(job_id)) is not None and record.stage == "walking"
        )
        record = self.records.get(job_id)
        assert record is not None
        return record

    def processes(self) -> list[int]:
        """All that the workers and their horses started and that still lives."""
        found = []
        for entry in Path("/proc").iterdir():
            try:
                marked = f"TEST_HANDS={self.folder}".encode() in (entry / "environ").read_bytes()
                if marked and (entry / "stat").read_text().rpartition(")")[2].split()[0] != "Z":
                    found.append(int(entry.name))
            except (OSError, ValueError):
                continue
        return found


@pytest.fixture
def hands(redis_server, records, queues, errand, eventually, tmp_path) -> Iterator[Hands]:
    hands = Hands(redis_server.url, tmp_path, records, queues, errand, eventually)
    yield hands
    for worker in hands.workers:
        worker.kill()
        worker.wait()
    eventually(lambda: not hands.processes())
