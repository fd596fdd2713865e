"""One attempt at a job, inside the process that was forked for it."""

import errno
import importlib
import logging
import resource
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType, ModuleType
from typing import Final

from redis import RedisError

from model.errors import InputError
from worker.kinds import Kind, OutOfTimeError, Postponed, Run
from worker.progress import Progress
from worker.queues import connect
from worker.record import JobError, JobRecord, files_prefix
from worker.records import Fenced, Records
from worker.storage import Storage, StorageError
from worker.webhooks import deliver, secret_of

DONE: Final = 0
AGAIN: Final = 75
"""Exit code: the job is fine, but the disk, the store or Redis is not."""
CRASHED: Final = 1
TELL_S: Final = 0.5
"""Progress within a stage is told this often at most [s]."""
OVER: Final = "done"
"""A stage that is not told: a job is done once its result is published."""
NEARLY: Final = 99.0
"""Progress until the result is published [%]."""

LOG = logging.getLogger("matphys.job")

BAD_INPUT: Final = "The input cannot be used"
TOO_LARGE: Final = JobError(
    type="out-of-memory",
    title="The job needs more memory than it may have",
    detail="try a shorter clip, fewer pixels or fewer points",
)
OUT_OF_MEMORY: Final = (
    "can't allocate memory",  # torch
    "Insufficient memory",  # OpenCV
)
TOO_SLOW: Final = JobError(
    type="timeout",
    title="The job takes longer than it may",
    detail="try a shorter clip, fewer pixels or fewer points",
)


@dataclass(frozen=True)
class Place:
    """Where a job finds everything."""

    redis_url: str
    store_url: str
    webhooks_to_private: bool = False


def run(record: JobRecord, attempt: int, kind: Kind, folder: Path, place: Place) -> int:
    """Make one attempt, and say with the exit code what is left to do.

    Args:
        record: The job, as it was when the attempt began.
        attempt: Which one; whatever changes the job is checked against it.
        kind: What to do.
        folder: For all that is written; its caller removes it.
        place: Where Redis and the store are.
    """
    redis = connect(place.redis_url)
    records, progress = Records(redis), Progress(redis)
    try:
        storage = Storage(place.store_url)
        with _memory(kind.memory_bytes), _time(kind.limit_s) as outside:
            report = Report(records, progress, record.id, attempt, outside)
            outcome = kind.run(
                Run(
                    record=record,
                    attempt=attempt,
                    parent=records.get(record.parent) if record.parent else None,
                    inputs=_fetch_inputs(record, storage, folder),
                    folder=folder,
                    report=report,
                    log=report.log,
                    fetch=lambda other, name: _fetch(other, name, storage, folder),
                    send=lambda url, message_id, body: deliver(
                        url,
                        message_id,
                        datetime.now(UTC),
                        body,
                        secret_of(redis, record.tenant),
                        allow_private=place.webhooks_to_private,
                    ),
                    model=_model,
                )
            )
            report("publishing", 1.0)
            prefix = f"{files_prefix(record.id)}{attempt}/"
            files = [storage.publish(prefix + path.name, path) for path in outcome.files]
        records.succeed(record.id, attempt, files, outcome.metrics or {}, report.ended())
        return DONE
    except (Exception, OutOfTimeError) as error:
        return _settle(error, records, record, attempt, folder)


def _settle(error: BaseException, records: Records, record: JobRecord, attempt: int, folder: Path) -> int:
    """What an attempt that brought no result means for the job."""
    extra = {"outcome": type(error).__name__}
    try:
        match error:
            case Fenced():
                LOG.info("the job is no longer ours", extra=extra)
            case Postponed():
                records.postpone(record.id, attempt, error.seconds)
            case InputError():
                detail = str(error).replace(f"{folder}/", "")
                records.fail(record.id, attempt, JobError(type="bad-input", title=BAD_INPUT, detail=detail))
            case _ if _exhausted(error):
                LOG.warning("out of memory", exc_info=error, extra=extra)
                records.fail(record.id, attempt, TOO_LARGE)
            case OutOfTimeError():
                records.fail(record.id, attempt, TOO_SLOW)
            case StorageError() | RedisError() | OSError(errno=errno.ENOSPC | errno.EDQUOT):
                LOG.warning("the surroundings fail: %s", error, extra=extra)
                return AGAIN
            case _:
                LOG.error("the job crashed", exc_info=error, extra=extra)
                return CRASHED
    except Fenced:
        LOG.info("the job is no longer ours", extra=extra)
    except RedisError:
        return AGAIN
    return DONE


def _exhausted(error: BaseException) -> bool:
    """Whether memory was what lacked; torch and OpenCV say so in words."""
    return isinstance(error, MemoryError) or any(words in str(error) for words in OUT_OF_MEMORY)


class Report:
    """Takes the progress of the work to the record and the log."""

    def __init__(
        self,
        records: Records,
        progress: Progress,
        job_id: str,
        attempt: int,
        outside: Callable[[], AbstractContextManager[None]],
    ) -> None:
        """Of one attempt; what is done `outside` does not count for its time."""
        self._records, self._progress, self._outside = records, progress, outside
        self._job_id, self._attempt = job_id, attempt
        self._stage, self._began, self._told = "", 0.0, 0.0

    def __call__(self, stage: str, share: float) -> None:
        """Tell it: every new stage, and what happens within one twice a second.

        Raises:
            Fenced: the job is no longer this attempt's.
        """
        if stage == OVER:
            return
        fresh = stage != self._stage
        if not fresh and time.monotonic() - self._told < TELL_S:
            return
        ended = self.ended() if fresh else None
        if fresh:
            self.log(f"{stage} begins")
        with self._outside():
            self._records.advance(self._job_id, self._attempt, stage, min(100.0 * share, NEARLY), ended)
        self._told = time.monotonic()
        if fresh:
            self._stage, self._began = stage, self._told

    def log(self, line: str) -> None:
        """Add a line to the log that the job's owner reads."""
        at = datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
        with self._outside():
            self._progress.log(self._job_id, [f"{at} {line}"])

    def ended(self) -> tuple[str, float] | None:
        """The stage at work and its seconds, as it ends now."""
        if not self._stage:
            return None
        seconds = time.monotonic() - self._began
        LOG.info("stage ended", extra={"stage": self._stage, "seconds": round(seconds, 3)})
        return self._stage, seconds


def _fetch_inputs(record: JobRecord, storage: Storage, folder: Path) -> Mapping[str, Path]:
    inputs = {}
    for name, key in record.inputs.items():
        inputs[name] = folder / "input" / key.rpartition("/")[2]
        inputs[name].parent.mkdir(exist_ok=True)
        storage.fetch(key, inputs[name])
    return inputs


def _fetch(other: JobRecord, name: str, storage: Storage, folder: Path) -> Path:
    file = other.file(name)
    if file is None:
        raise InputError(f"{name} is gone: make it again")
    path = folder / "parent" / name
    path.parent.mkdir(exist_ok=True)
    storage.fetch(file.key, path)
    return path


def _model(name: str) -> ModuleType:
    """A module of the model, imported here alone, so that nothing which a front imports leads to torch."""
    return importlib.import_module(f"model.{name}")


@contextmanager
def _memory(more_bytes: int) -> Iterator[None]:
    """Let this process have so much address space beyond what it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@contextmanager
def _time(seconds: float) -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Raise OutOfTimeError after so long; `worker.guard` ends what does not come back from native code.

    Gives what stops the clock: waiting for Redis is not the job's fault.
    """

    def ring(number: int, frame: FrameType | None) -> None:
        raise OutOfTimeError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)

    @contextmanager
    def stopped() -> Iterator[None]:
        rest = signal.setitimer(signal.ITIMER_REAL, 0.0)[0]
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, rest)

    try:
        yield stopped
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
