"""Whether a front can do its work now."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooSlow
from threading import Lock

from redis import Redis
from redis.exceptions import RedisError

from service.uploads import Intake
from worker.queues import ALL_QUEUES, Queues
from worker.storage import Storage

CHECK_SECONDS = 5.0
"""A check that takes longer has failed [s]."""
VALID_SECONDS = 1.0
"""How long an answer is given again [s]: anybody may ask, and each answer costs a write to the store."""


class Readiness:
    """Asks everything that a submission needs."""

    def __init__(self, redis: Redis, queues: Queues, storage: Storage, intake: Intake) -> None:
        """Ask nothing yet."""
        self._redis, self._queues, self._storage, self._intake = redis, queues, storage, intake
        self._lock = Lock()
        self._found: Mapping[str, str] = {}
        self._until = 0.0

    def check(self) -> Mapping[str, str]:
        """Name of the check → `ok`, or what is wrong."""
        with self._lock:
            if time.monotonic() > self._until:
                self._found = self._ask()
                self._until = time.monotonic() + VALID_SECONDS
            return self._found

    def _ask(self) -> Mapping[str, str]:
        checks: dict[str, Callable[[], str]] = {
            "redis": lambda: "ok" if self._redis.set("matphys:ready", "1", ex=60) else "cannot be written",
            "store": lambda: "ok" if self._storage.writable() else "cannot be written",
            "disk": self._disk,
            "workers": self._workers,
        }
        pool = ThreadPoolExecutor(len(checks))
        try:
            started = {name: pool.submit(check) for name, check in checks.items()}
            deadline = time.monotonic() + CHECK_SECONDS
            found = {}
            for name, future in started.items():
                try:
                    found[name] = future.result(max(0.0, deadline - time.monotonic()))
                except TooSlow:
                    found[name] = "does not answer"
                except (RedisError, OSError):
                    found[name] = "cannot be reached"
            return found
        finally:
            pool.shutdown(wait=False)

    def _workers(self) -> str:
        workers = self._queues.workers()
        if not workers:
            return "none alive"
        idle = [name for name in ALL_QUEUES if all(name not in worker.queues for worker in workers)]
        return f"none alive for {', '.join(idle)}" if idle else "ok"

    def _disk(self) -> str:
        room = [self._intake.free_bytes()]
        in_store = self._storage.free_bytes()
        if in_store is not None:
            room.append(in_store - self._intake.min_free_bytes)
        return "ok" if min(room) > 0 else "almost full"
