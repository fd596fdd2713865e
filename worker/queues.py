"""The only file that knows rq: how a job gets from the front to a worker.

rq moves the id of a job to a free worker, which forks a process for it. It decides nothing: whether that
process may work is for `worker.records` to say, so a lost or doubled delivery costs nothing but a moment.
"""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar, cast

import redis.backoff
import redis.exceptions
import redis.retry
import rq
from redis import ConnectionPool, Redis
from rq.exceptions import NoSuchJobError
from rq.job import Job
from rq.serializers import JSONSerializer

from model.errors import InputError
from worker.record import JobRecord
from worker.records import Records

T = TypeVar("T")

ALL_QUEUES: tuple[str, ...] = ("webhooks", "exports", "twins")
"""In the order in which a worker looks for work: what takes a moment first."""
FUNCTION = "worker.jobs.run"
"""What the forked process calls, with the id of the job."""
PATIENCE_S = 60.0
ANSWER_S = 5.0
"""How long Redis may take to answer before a try has failed [s]."""
REFUSED_S = 0.5
"""Pause before a command that Redis refused is sent again [s]."""
ALIVE_S = 20.0
"""A worker that has not been heard of for this long is taken for dead [s]; it speaks every 5 s at least."""
SETTLED_S = 1.0
"""How long a job may be on its way between the records and rq before it is handed over again [s]."""
FORGET_S = 600
"""How long rq keeps its own traces of a job [s]."""
NEVER_S = 7 * 86400
"""rq's own time limit, out of the way [s]: limits are kept by `worker.jobs` and `worker.guard`."""


@dataclass(frozen=True)
class WorkerState:
    """What a worker last said about itself."""

    name: str
    state: str
    """`started`, `idle`, `busy` or `suspended`."""
    heartbeat: datetime
    """UTC."""
    queues: tuple[str, ...]


class Patience(redis.retry.Retry):
    """Tries again for so many seconds, however long each try takes: a Redis that hangs is given up too."""

    def __init__(self, seconds: float) -> None:
        """Pauses of 0.1 s, twice that, and so on, at most 1 s."""
        super().__init__(redis.backoff.ExponentialBackoff(cap=1.0, base=0.05), retries=-1)
        self._seconds = seconds

    def call_with_retry(
        self,
        do: Callable[[], T],
        fail: Callable[..., Any],
        is_retryable: Callable[[Exception], bool] | None = None,
        with_failure_count: bool = False,
    ) -> T:
        """Call `do` until it works, and `fail` with each error, which gives the broken connection up."""
        deadline = time.monotonic() + self._seconds

        def fail_in_time(error: Exception, *count: int) -> None:
            fail(error, *count)
            if time.monotonic() > deadline:
                raise error

        return super().call_with_retry(do, fail_in_time, is_retryable, with_failure_count)


class PatientRedis(Redis):
    """A Redis that is also waited for while it refuses to write, as when its disk is full."""

    patience_s = PATIENCE_S

    def execute_command(self, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - as the base has it
        """Send a command until Redis takes it."""
        deadline = time.monotonic() + self.patience_s
        while True:
            try:
                return super().execute_command(*arguments, **options)  # type: ignore[no-untyped-call]
            except redis.exceptions.ResponseError as error:
                if "MISCONF" not in str(error) or time.monotonic() > deadline:
                    raise
            time.sleep(REFUSED_S)

    def client(self) -> "PatientRedis":
        """One connection of the pool for oneself, until it is closed."""
        one = PatientRedis(connection_pool=self.connection_pool, single_connection_client=True)
        one.patience_s = self.patience_s
        return one


def connect(url: str, patience_s: float = PATIENCE_S) -> "Redis":
    """A connection to Redis that rides out an outage; it speaks text.

    Args:
        url: `redis://`, `rediss://` or `unix://`.
        patience_s: How long a call tries again before it raises [s]. Workers wait long; a front that owes
            somebody an answer waits less.

    Raises:
        InputError: the URL is none.
    """
    try:
        made = PatientRedis.from_url(
            url,
            decode_responses=True,
            socket_timeout=ANSWER_S,
            socket_connect_timeout=2.0,
            health_check_interval=15,
            retry=Patience(patience_s),
            retry_on_error=[
                redis.exceptions.ConnectionError,
                redis.exceptions.TimeoutError,
                redis.exceptions.BusyLoadingError,
            ],
        )
    except ValueError:  # the URL may hold a password: it is not repeated
        raise InputError("REDIS_URL: expected redis://HOST:PORT, rediss://… or unix://…") from None
    client = cast(PatientRedis, made)
    client.patience_s = patience_s
    return client


def in_bytes(client: "Redis") -> "Redis":
    """A connection like `client` that speaks bytes, as rq needs it."""
    pool = client.connection_pool
    settings = {**pool.connection_kwargs, "decode_responses": False}
    other = PatientRedis(connection_pool=ConnectionPool(connection_class=pool.connection_class, **settings))
    other.patience_s = getattr(client, "patience_s", PATIENCE_S)
    return other


class Queues:
    """The way of jobs to workers.

    Args:
        redis: As `connect` makes it.
        records: Over the same Redis.
    """

    def __init__(self, redis: "Redis", records: Records) -> None:
        """See the class."""
        self._redis = in_bytes(redis)
        self._records = records

    def close(self) -> None:
        """Give the connections back; what is asked afterwards opens new ones."""
        self._redis.connection_pool.disconnect()

    def enqueue(self, record: JobRecord) -> None:
        """Let a worker have a job that `Records.create` accepted. Should this fail, `reconcile` does it."""
        self._queue(record.queue).enqueue_call(
            FUNCTION,
            args=(record.id,),
            job_id=f"{record.id}_{record.attempt}",
            description=record.id,
            timeout=NEVER_S,
            result_ttl=0,
            failure_ttl=FORGET_S,
        )

    def position(self, record: JobRecord) -> int | None:
        """How many jobs are before this one; None: it does not wait."""
        return self._records.position(record) if record.status == "queued" else None

    def depth(self) -> dict[str, int]:
        """How many jobs wait, by queue."""
        return {name: self._records.depth(name) for name in ALL_QUEUES}

    def cancel(self, job_id: str) -> str | None:
        """Cancel a job: what waits never starts, what runs is stopped within two seconds.

        Gives the status it had; None: no such job.
        """
        record = self._records.get(job_id)
        before = self._records.cancel(job_id)
        if record is not None and before == "queued":
            with contextlib.suppress(NoSuchJobError):
                name = f"{job_id}_{record.attempt}"
                Job.fetch(name, connection=self._redis, serializer=JSONSerializer).delete()
        return before

    def workers(self) -> Sequence[WorkerState]:
        """The workers that are alive."""
        now = datetime.now(UTC)
        states = []
        for worker in rq.Worker.all(connection=self._redis, serializer=JSONSerializer):
            heard = worker.last_heartbeat
            if heard is not None and (now - heard).total_seconds() < ALIVE_S:
                states.append(
                    WorkerState(worker.name, worker.get_state(), heard, tuple(worker.queue_names()))
                )
        return states

    def reconcile(self) -> int:
        """Hand over the jobs that wait and that rq does not have: after a crash, or when their time has come.

        Gives how many. One that was just taken may go out twice; the second run finds nothing to do.
        """
        count = 0
        for name in ALL_QUEUES:
            due = self._records.due(name, SETTLED_S)
            known = {key.rpartition("_")[0] for key in self._queue(name).get_job_ids()} if due else set()
            for job_id in due:
                record = self._records.get(job_id) if job_id not in known else None
                if record is not None and record.status == "queued":
                    self.enqueue(record)
                    count += 1
        return count

    def _queue(self, name: str) -> rq.Queue:
        return rq.Queue(name, connection=self._redis, serializer=JSONSerializer)
