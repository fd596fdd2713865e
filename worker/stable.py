"""The loop of a worker: rq's, with our own processes. Beside `worker.queues`, all that knows rq."""

import itertools
import time
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Final

import redis.exceptions
import rq
from redis import Redis
from redis.client import Pipeline
from rq.job import Job
from rq.serializers import JSONSerializer
from rq.worker import WorkerStatus

from worker.queues import in_bytes
from worker.shepherd import Shepherd

WORKER_TTL: Final = 20
"""rq waits 15 s less for a job before it says again that the worker is alive [s]."""
MAINTENANCE_S: Final = 300
CLOCK_S: Final = 1.0


class Stable(rq.Worker):
    """Takes jobs from the queues and gives them to a shepherd.

    rq's own way of running a job (its horse, its registries, its retries) is not used: `worker.records` knows
    more, and one truth is enough. Used are the queues, the signals, and the register of live workers.

    Args:
        name: Not used by any other live worker.
        queues: Names, in the order in which to look.
        redis: As `worker.queues.connect` makes it.
        shepherd: Tends the jobs.
        pulse: Called every few seconds.
    """

    max_connection_wait_time = CLOCK_S

    def __init__(
        self,
        name: str,
        queues: Sequence[str],
        redis: "Redis",
        shepherd: Shepherd,
        pulse: Callable[[], None],
    ) -> None:
        """See the class."""
        super().__init__(
            list(queues),
            name=name,
            connection=in_bytes(redis),
            serializer=JSONSerializer,
            worker_ttl=WORKER_TTL,
            maintenance_interval=MAINTENANCE_S,
        )
        self._shepherd, self._pulse = shepherd, pulse
        self.told_to_stop = False

    def request_stop(self, signum: int, frame: FrameType | None) -> None:
        """Stop after the job at work, or at once when there is none."""
        self.told_to_stop = True
        super().request_stop(signum, frame)  # type: ignore[no-untyped-call]

    def heartbeat(self, timeout: int | None = None, pipeline: Pipeline | None = None) -> None:
        """Say that the worker is alive."""
        super().heartbeat(timeout, pipeline)
        self._pulse()

    def execute_job(self, job: Job, queue: rq.Queue) -> None:
        """Hand the job to the shepherd, and forget what rq knows of it."""
        self.set_state(WorkerStatus.BUSY)
        self.connection.lrem(queue.intermediate_queue_key, 1, job.id)
        self._shepherd.tend(job.args[0], self.heartbeat, lambda: self.told_to_stop)
        job.delete(remove_from_queue=False)
        self.set_state(WorkerStatus.IDLE)

    def subscribe(self) -> None:
        """Rq's commands are not heard: a canceled job is stopped by its fence, and no thread is forked."""


def work(make: Callable[[int], Stable]) -> None:
    """Work until told to stop; a loop that breaks off, as when Redis was away for long, is begun anew.

    Args:
        make: Gives a loop, the first for 0; each with another name, since the last may not have signed off.
    """
    for number in itertools.count():
        stable: Stable | None = None
        try:
            stable = make(number)
            stable.work(logging_level="WARNING")
        except redis.exceptions.RedisError:
            pass
        # where Redis ends at the same time, as when all of a service is killed, the loop breaks off instead
        if stable is not None and stable.told_to_stop:
            return
        time.sleep(CLOCK_S)
