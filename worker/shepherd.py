"""Tends one job after the other: begins an attempt, forks a process for it, and answers for how it ends."""

import contextlib
import logging
import os
import shutil
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from redis import RedisError

from worker import jobs
from worker.guard import Guard
from worker.horse import Horse
from worker.kinds import Kind
from worker.record import JobError, JobRecord
from worker.records import Records

LATE_S: Final = 0.5
"""By how much a guard may be early [s]."""
LOOK_S: Final = 1.0
"""How often a worker says that it is alive and asks whether the job is still wanted [s]."""
LONGEST_PAUSE_S: Final = 60.0
MOST_ATTEMPTS: Final = 500
"""After so many, the surroundings are not what is wrong."""
CRASH: Final = JobError(
    type="crash",
    title="The job failed",
    detail="it broke off without a result, several times; the fault is ours, and it has been logged",
)

LOG = logging.getLogger("matphys.worker")


class Shepherd:
    """Runs jobs for one worker.

    Args:
        name: Of the worker.
        records: Of the jobs.
        kinds: What this worker can do.
        guard: Ends what is left behind.
        scratch: A folder of this worker alone.
        place: Where jobs find Redis and the store.
        grace_s: How long a job may go on once the worker is to stop [s].
        mercy_s: How long a job may go on after its limit, where only a kill can stop it [s].
    """

    def __init__(
        self,
        name: str,
        records: Records,
        kinds: Iterable[Kind],
        guard: Guard,
        scratch: Path,
        place: jobs.Place,
        grace_s: float,
        mercy_s: float,
    ) -> None:
        """See the class."""
        self._name, self._records, self._kinds = name, records, {kind.name: kind for kind in kinds}
        self._guard, self._scratch, self._place = guard, scratch, place
        self._grace_s, self._mercy_s = grace_s, mercy_s

    def tend(self, job_id: str, heartbeat: Callable[[], None], stopping: Callable[[], bool]) -> None:
        """Make one attempt at a job, if it may be made.

        Args:
            job_id: Of the job.
            heartbeat: Called every second.
            stopping: Whether the worker is to stop.
        """
        record = self._records.get(job_id)
        if record is None or record.final:
            return
        kind = self._kinds.get(record.kind)
        if kind is None:  # of a newer version: there is a worker for it
            LOG.warning("a kind of job that is unknown here", extra={"job": job_id, "kind": record.kind})
            return
        attempt = self._records.begin(job_id, uuid.uuid4().hex, self._name)
        if attempt is None:
            return
        LOG.info("attempt begins", extra={"job": job_id, "kind": kind.name, "attempt": attempt})
        began = time.monotonic()
        ended = self._attempt(record, attempt, kind, heartbeat, stopping)
        seconds = round(time.monotonic() - began, 3)
        about = {"job": job_id, "kind": kind.name, "attempt": attempt, "seconds": seconds, "outcome": ended}
        LOG.info("attempt ended", extra=about)

    def _attempt(
        self,
        record: JobRecord,
        attempt: int,
        kind: Kind,
        heartbeat: Callable[[], None],
        stopping: Callable[[], bool],
    ) -> str | None:
        """Give the job a process and a folder; says what became of the job."""
        folder = self._scratch / f"{record.id}-{attempt}"
        try:
            folder.mkdir(mode=0o700)
        except OSError as error:
            LOG.warning("no folder for a job: %s", error, extra={"job": record.id})
            return self._records.hand_back(record.id, attempt, _pause(attempt))
        limit = kind.limit_s + self._mercy_s

        def work() -> int:
            # what is left half-written by a horse that is killed goes with its folder
            tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
            return jobs.run(record, attempt, kind, folder, self._place)

        horse = Horse(
            work,
            self._guard,
            limit,
            worker=self._name,
            job=record.id,
            attempt=attempt,
        )
        began = time.monotonic()
        asked: float | None = None
        try:
            while (code := horse.wait(LOOK_S)) is None:
                if stopping() and asked is None:
                    asked = time.monotonic()
                    horse.kill_within(self._grace_s)
                self._look_after(record, attempt, horse, heartbeat)
        except BaseException:  # told to stop at once
            horse.stop()
            with contextlib.suppress(RedisError):
                self._records.hand_back(record.id, attempt)
            raise
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        over = time.monotonic()
        if code < 0 and asked is not None and over - asked >= self._grace_s:
            return self._records.hand_back(record.id, attempt)
        return self._settle(record, attempt, code, over - began > limit - LATE_S)

    def _look_after(
        self, record: JobRecord, attempt: int, horse: Horse, heartbeat: Callable[[], None]
    ) -> None:
        """Hold the job for another while; stop the horse when it is no longer wanted."""
        try:
            heartbeat()
            if not self._records.renew(record.id, attempt) and not self._settled(record.id, attempt):
                LOG.info("the job is no longer ours", extra={"job": record.id, "attempt": attempt})
                horse.stop()
        except RedisError as error:  # the horse may well outlast it
            LOG.warning("Redis is away: %s", error, extra={"job": record.id})

    def _settled(self, job_id: str, attempt: int) -> bool:
        """Whether this attempt has ended the job, so that its process is about to end too."""
        record = self._records.get(job_id)
        return record is not None and record.attempt == attempt and record.status in ("succeeded", "failed")

    def _settle(self, record: JobRecord, attempt: int, code: int, late: bool) -> str | None:
        """What the end of the process means for the job."""
        if code == jobs.DONE:
            return "settled"
        if code == jobs.AGAIN and attempt < MOST_ATTEMPTS:
            return self._records.hand_back(record.id, attempt, _pause(attempt))
        LOG.warning("a job's process ended with %s", code, extra={"job": record.id, "attempt": attempt})
        if late:
            self._records.fail(record.id, attempt, jobs.TOO_SLOW)
            return "failed"
        return self._records.crash(record.id, attempt, CRASH)


def _pause(attempt: int) -> float:
    """How long to wait when disk, store or Redis fail: longer each time [s]."""
    return float(min(LONGEST_PAUSE_S, 2.0 ** min(attempt, 10)))
