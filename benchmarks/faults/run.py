"""Break a small service of real processes in every way, under load, and see whether it loses a job.

    python benchmarks/faults/run.py [--jobs 100] [--quick]

A real Redis, a real front and three real workers; the jobs are errands (`errand.py`): a fraction of a second
each, with an uploaded input and a published result, so that a hundred of them fit into minutes. As root,
all of it (store, uploads, work in progress, Redis) lies on a small file system, which one fault fills.

A fault's recovery is the time from the fault (of an outage: from its end) until both the job it hit and a job
submitted just then have succeeded. Exit code 1: a job was lost or published twice, or something was left.
"""

import argparse
import os
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path

from load import Load
from redis import RedisError
from system import System, running

from worker.janitor import sweep
from worker.progress import Progress
from worker.record import files_prefix
from worker.storage import Storage

WORKERS = 3
DISK_MIB = 48
LATEST_S = 90.0
"""A job that has not succeeded by then counts as lost [s]."""
STEP_S = 0.02


@dataclass
class Table:
    """What happened."""

    seconds: dict[str, list[float]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)

    def add(self, fault: str, seconds: float) -> None:
        """Note and print a recovery."""
        self.seconds.setdefault(fault, []).append(seconds)
        print(f"  {fault}: back after {seconds:.1f} s", flush=True)

    def show(self) -> None:
        """Print it."""
        print(f"\n{'fault':<28}{'times':>6}{'recovered':>11}{'median s':>10}{'max s':>8}")
        for fault, seconds in self.seconds.items():
            good = [each for each in seconds if each < LATEST_S]
            median, most = statistics.median(seconds), max(seconds)
            print(f"{fault:<28}{len(seconds):>6}{len(good):>11}{median:>10.1f}{most:>8.1f}")


class Breaker:
    """Does the faults, one at a time, and looks after the system meanwhile.

    Args:
        system: To be broken.
        load: Submits jobs meanwhile.
        outage_s: How long an outage lasts [s].
    """

    def __init__(self, system: System, load: Load, outage_s: float) -> None:
        """See the class."""
        self.system, self.load, self.outage_s = system, load, outage_s
        self.hit = 0.0
        """When the last fault was done, or its outage over [s]."""

    def kill_horse(self) -> list[str]:
        """The process of one job."""
        victim = self._running_job()
        worker = self.system.worker_of(victim)
        horse = None if worker is None else self.system.horse_of(worker)
        if horse is None:
            raise RuntimeError("no horse to kill")
        self._strike(horse, signal.SIGKILL)
        return [victim]

    def kill_worker(self) -> list[str]:
        """A worker with a job."""
        victim = self._running_job()
        worker = self.system.worker_of(victim)
        if worker is None:
            raise RuntimeError("no worker to kill")
        self._strike(worker.pid, signal.SIGKILL)
        return [victim]

    def kill_front(self) -> list[str]:
        """The front, with uploads under way."""
        victims = [self.load.ask(company=True) for _ in range(3)]
        self.pass_time(0.05)
        self._strike(self.system.front.pid, signal.SIGKILL)
        self.wait_for(lambda: all(victim.done() for victim in victims))
        return [victim.result() for victim in victims]

    def kill_redis(self) -> list[str]:
        """Redis, with a job at work and one being accepted."""
        victim = self._running_job()
        self.load.ask()
        self._strike(self.system.redis.pid or 0, signal.SIGKILL)
        return [victim]

    def freeze_redis(self) -> list[str]:
        """Redis keeps its connections and does not answer."""
        victim, pid = self._running_job(), self.system.redis.pid or 0
        os.kill(pid, signal.SIGSTOP)
        self.pass_time(self.outage_s)
        self._strike(pid, signal.SIGCONT)
        return [victim]

    def stop_redis(self) -> list[str]:
        """Redis is shut down and started again later."""
        victim = self._running_job()
        self.system.redis_away = True
        os.kill(self.system.redis.pid or 0, signal.SIGTERM)
        self.pass_time(self.outage_s)
        self.system.redis_away, self.hit = False, time.monotonic()
        return [victim]

    def fill_disk(self) -> list[str]:
        """No byte is free for store, uploads, work in progress and Redis."""
        victim = self._running_job()
        balloon = self.system.disk / "balloon"
        with balloon.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(1 << 16))
            except OSError:
                pass
        self.pass_time(self.outage_s)
        balloon.unlink()
        self.hit = time.monotonic()
        return [victim]

    def roll_workers(self) -> list[str]:
        """One job ends within the grace, two are handed back."""
        victims = [self._running_job(seconds) for seconds in (0.8, 3.0, 3.0)]
        for worker in self.system.workers:
            self._strike(worker.pid, signal.SIGTERM)
        return victims

    def pass_time(self, seconds: float) -> None:
        """Wait, and look after the system."""
        deadline = time.monotonic() + seconds
        self.wait_for(lambda: time.monotonic() >= deadline)

    def wait_for(self, true: Callable[[], bool], seconds: float = LATEST_S) -> bool:
        """Wait until something holds, and look after the system; gives whether it does."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.system.look_after()
            try:
                if true():
                    return True
            except RedisError:
                pass
            time.sleep(STEP_S)
        return False

    def recovered(self, victims: list[str], canary: "Future[str]") -> bool:
        """Wait until the jobs that were hit, and one submitted after that, have succeeded."""
        return self.wait_for(lambda: canary.done() and all(map(self.succeeded, [*victims, canary.result()])))

    def state(self, victims: list[str], canary: "Future[str]") -> str:
        """What is known of jobs that did not come through."""
        ids = [*victims, *([canary.result()] if canary.done() else [])]
        records = [self.system.records.get(job_id) for job_id in ids]
        return "; ".join(
            f"{each and (each.id, each.status, each.stage, each.attempt, each.error)}" for each in records
        )

    def succeeded(self, job_id: str) -> bool:
        """Whether a job has its result."""
        record = self.system.records.get(job_id)
        return record is not None and record.status == "succeeded"

    def _strike(self, pid: int, number: int) -> None:
        os.kill(pid, number)
        self.hit = time.monotonic()

    def _running_job(self, seconds: float = 2.0) -> str:
        """A job that runs now, in the company of a process that would outlive it."""
        asked = self.load.ask(seconds=seconds, company=True)
        self.wait_for(asked.done)
        job_id = asked.result()
        self.wait_for(
            lambda: (record := self.system.records.get(job_id)) is not None and record.stage == "walking"
        )
        return job_id


def check(system: System, load: Load, table: Table) -> int:
    """Whether every job that was accepted is there, once; gives how many there are."""
    accepted = {future.result() for future in load.futures if future.exception() is None}
    table.problems += [
        f"never accepted: {future.exception()}" for future in load.futures if future.exception()
    ]
    progress = Progress(system.client)
    crashes = 0
    for job_id in accepted:
        record = system.records.get(job_id)
        if record is None or record.status != "succeeded":
            table.problems.append(f"lost: {job_id} {record and (record.status, record.error)}")
            continue
        ends = [event for event in progress.read(job_id) if event.final]
        if len(ends) != 1:
            table.problems.append(f"ended {len(ends)} times: {job_id}")
        crashes += record.attempt - 1
    known, cursor = 0, None
    while True:
        page, cursor = system.records.list("faults", "errand", cursor=cursor, limit=100)
        known += len(page)
        if cursor is None:
            break
    published = int(system.client.hget("matphys:outcomes", "errand|succeeded") or 0)
    if not len(accepted) == known == published:
        table.problems.append(f"{len(accepted)} accepted, {known} known, {published} published")
    print(f"\n{len(accepted)} jobs, {crashes} attempts beyond the first, {load.repeats} requests sent again")
    return len(accepted)


def check_files(system: System, table: Table) -> None:
    """Whether the store holds the files of the jobs, whole, and nothing else, once it has been swept."""
    garbage = dict.fromkeys(system.client.zrange("matphys:garbage", 0, -1), 0)
    if garbage:
        system.client.zadd("matphys:garbage", garbage)  # the sweep is brought forward
    storage = Storage(system.store_url)
    while system.records.garbage():
        sweep(system.records, storage)
    expected, cursor = set(), None
    while True:
        page, cursor = system.records.list("faults", "errand", cursor=cursor, limit=100)
        for record in page:
            expected |= {*record.inputs.values(), *(file.key for file in record.files)}
            for file in record.files:
                if storage.size(file.key) != file.bytes or not file.key.startswith(
                    f"{files_prefix(record.id)}{record.attempt}/"
                ):
                    table.problems.append(f"not as published: {file.key}")
        if cursor is None:
            break
    root = system.disk / "store"
    present = {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
    table.problems += [f"missing: {key}" for key in expected - present]
    table.problems += [f"left in the store: {key}" for key in present - expected]


def check_leftovers(system: System, table: Table) -> None:
    """Whether anything runs or lies about after the system has been stopped."""
    table.problems += [f"still runs: {command}" for command in system.left_over()]
    for place in ("scratch", "front/staging"):
        files = [path for path in (system.disk / place).rglob("*") if path.is_file() and path.name != "lock"]
        table.problems += [f"left behind: {path}" for path in files]


def main() -> int:
    """Break it, and give the exit code."""
    arguments = argparse.ArgumentParser(description="Faults under load.")
    arguments.add_argument("--jobs", type=int, default=100, help="submit at least so many")
    arguments.add_argument("--quick", action="store_true", help="every fault once, outages of 3 s")
    arguments.add_argument("--only", default="", metavar="WORD", help="faults with this word in their name")
    given = arguments.parse_args()
    root = os.geteuid() == 0
    times, outages = (1, 1) if given.quick else (3, 2)
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    table, began = Table(), time.monotonic()
    with running(folder, WORKERS, DISK_MIB if root else None) as system:
        load = Load(system.url, system.key, per_second=1.5, least=given.jobs)
        breaker = Breaker(system, load, outage_s=3.0 if given.quick else 10.0)
        faults: list[tuple[str, Callable[[], list[str]], int]] = [
            ("kill -9 of a horse", breaker.kill_horse, times),
            ("kill -9 of a worker", breaker.kill_worker, times),
            ("kill -9 of the front", breaker.kill_front, times),
            ("kill -9 of Redis", breaker.kill_redis, times),
            (f"Redis frozen {breaker.outage_s:.0f} s", breaker.freeze_redis, outages),
            (f"Redis stopped {breaker.outage_s:.0f} s", breaker.stop_redis, outages),
            ("SIGTERM to all workers", breaker.roll_workers, outages),
        ]
        if root:
            faults.insert(6, (f"disk full {breaker.outage_s:.0f} s", breaker.fill_disk, outages))
        else:
            print("not root: the full disk is left out")
        try:
            breaker.wait_for(load.ask().done)
            for name, fault, count in faults:
                for _ in range(count if given.only in name else 0):
                    victims, canary = fault(), load.ask()
                    if not breaker.recovered(victims, canary):
                        table.problems.append(f"{name}: {breaker.state(victims, canary)}")
                    table.add(name, time.monotonic() - breaker.hit)
            load.stop()
            breaker.wait_for(load.done, 300.0)
            breaker.wait_for(lambda: system.records.running() + sum(system.queues.depth().values()) == 0)
        finally:
            load.close()
        check(system, load, table)
        check_files(system, table)
        for child in system.workers:
            child.signal(signal.SIGTERM)
        for child in (*system.workers, system.front):
            child.stop()
        system.redis.stop()
        check_leftovers(system, table)
    table.show()
    print(f"\n{time.monotonic() - began:.0f} s in all")
    for problem in table.problems:
        print(f"PROBLEM: {problem}")
    print(
        "nothing lost, nothing twice, nothing left"
        if not table.problems
        else f"{len(table.problems)} problems"
    )
    return 1 if table.problems else 0


if __name__ == "__main__":
    sys.exit(main())
