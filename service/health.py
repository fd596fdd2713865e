"""Whether a front can do its work now."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooSlow

import redis.exceptions

from service.front import Front

CHECK_SECONDS = 5.0
"""A check that takes longer has failed [s]."""


def check_readiness(front: Front) -> dict[str, str]:
    """Ask everything a submission needs; name → `ok`, or what is wrong."""
    checks: dict[str, Callable[[], str]] = {
        "redis": lambda: _redis(front),
        "store": lambda: "ok" if front.storage.writable() else "cannot be written",
        "disk": lambda: _disk(front),
        "workers": lambda: "ok" if front.queues.workers() else "none alive",
    }
    pool = ThreadPoolExecutor(len(checks))
    try:
        started = {name: pool.submit(check) for name, check in checks.items()}
        found = {}
        for name, future in started.items():
            try:
                found[name] = future.result(CHECK_SECONDS)
            except TooSlow:
                found[name] = "does not answer"
            except (redis.exceptions.RedisError, OSError):
                found[name] = "cannot be reached"
        return found
    finally:
        pool.shutdown(wait=False)


def _redis(front: Front) -> str:
    front.redis.set("matphys:ready", "1", ex=60)
    return "ok"


def _disk(front: Front) -> str:
    room = [front.intake.free_bytes()]
    in_store = front.storage.free_bytes()
    if in_store is not None:
        room.append(in_store - front.settings.min_free_bytes)
    return "ok" if min(room) > 0 else "almost full"
