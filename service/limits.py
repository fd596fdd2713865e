"""How often a key or an address may ask, counted in Redis for all fronts together."""

import math
import time

import limits
from limits.storage import RedisStorage
from limits.strategies import SlidingWindowCounterRateLimiter
from redis import Redis

from service.errors import ProblemError
from service.settings import Settings


class RateLimits:
    """The limits per minute, over a sliding window."""

    def __init__(self, redis: Redis, settings: Settings) -> None:
        """Ask Redis nothing yet."""
        storage = RedisStorage("redis://", connection_pool=redis.connection_pool, key_prefix="matphys:limits")
        self._limiter = SlidingWindowCounterRateLimiter(storage)
        self._amounts = {
            "request": limits.RateLimitItemPerMinute(settings.requests_per_minute),
            "submission": limits.RateLimitItemPerMinute(settings.submissions_per_minute),
            "refusal": limits.RateLimitItemPerMinute(settings.refusals_per_minute),
        }

    def count(self, what: str, who: str) -> None:
        """Count one `request`, `submission` or `refusal`.

        Raises:
            ProblemError: it was one too many; the answer says when to try again.
        """
        limit = self._amounts[what]
        if self._limiter.hit(limit, what, who):
            return
        wait = self._limiter.get_window_stats(limit, what, who).reset_time - time.time()
        raise ProblemError(
            "too-many-requests",
            f"at most {limit.amount} {what}s per minute",
            retry_after=max(0.0, math.ceil(wait)),
        )
