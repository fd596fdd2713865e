"""Housekeeping beside every worker: what a fault has left undone is found and done within seconds.

In a process of its own, since the store's threads would not survive the worker's forks. Every step may be
done by several janitors at once, or twice.
"""

import logging
import os
import random
import signal
import time
from typing import NoReturn

from redis import RedisError

from worker.guard import Guard
from worker.horse import end_with
from worker.jobs import Place
from worker.logs import log_as_json
from worker.queues import Queues, connect
from worker.records import Records
from worker.shepherd import CRASH
from worker.storage import Storage, StorageError

ROUND_S = 1.0
SWEEP_ROUNDS = 10
MOST_FAILURES = 5
"""To delete something, of a round."""

LOG = logging.getLogger("matphys.janitor")


class Janitor:
    """The process that keeps house; it ends with its worker."""

    def __init__(self, worker: str, place: Place, guard: Guard) -> None:
        """Start it."""
        self._worker, self._place, self._guard = worker, place, guard
        self._pid = self._start()

    def revive(self) -> None:
        """Start it again, should it have ended."""
        try:
            if os.waitpid(self._pid, os.WNOHANG)[0] == 0:
                return
        except ChildProcessError:
            pass
        self._pid = self._start()

    def close(self) -> None:
        """End it."""
        try:
            os.kill(self._pid, signal.SIGKILL)
            os.waitpid(self._pid, 0)
        except (ProcessLookupError, ChildProcessError):
            pass

    def _start(self) -> int:
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            try:
                end_with(parent)
                for number in (signal.SIGINT, signal.SIGTERM):
                    signal.signal(number, signal.SIG_IGN)
                self._guard.leave()
                log_as_json(self._worker)
                _keep_house(self._place)
            finally:
                os._exit(1)
        return pid


def _keep_house(place: Place) -> NoReturn:
    redis = connect(place.redis_url)
    records, storage = Records(redis), Storage(place.store_url)
    queues = Queues(redis, records)
    rounds = 0
    while True:
        try:
            tidy(records, queues)
            if rounds % SWEEP_ROUNDS == 0:
                sweep(records, storage)
        except (RedisError, StorageError) as error:
            LOG.warning("housekeeping is put off: %s", error)
        except Exception:
            LOG.exception("housekeeping failed")
        rounds += 1
        time.sleep(ROUND_S)


def tidy(records: Records, queues: Queues) -> None:
    """Take jobs back from workers that died, and hand over those that wait for nobody."""
    for job_id, status in records.reap(CRASH).items():
        LOG.warning("a job was lost by its worker", extra={"job": job_id, "outcome": status})
    count = queues.reconcile()
    if count:
        LOG.info("jobs handed over again", extra={"count": count})


def sweep(records: Records, storage: Storage) -> None:
    """Delete jobs whose time is over, and the files that belong to nothing."""
    count = records.expire()
    if count:
        LOG.info("jobs expired", extra={"count": count})
    failed = 0
    # in any order: what cannot be deleted must not keep what can, and a store that is down not this process
    garbage = records.garbage()
    for prefix in random.sample(garbage, len(garbage)):
        try:
            storage.delete(prefix)
        except StorageError as error:
            LOG.warning("%s is not deleted: %s", prefix, error)
            failed += 1
            if failed == MOST_FAILURES:
                return
        else:
            records.swept(prefix)
