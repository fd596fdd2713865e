"""What the routes work with: one connection of each kind, made once per process."""

import asyncio
from dataclasses import dataclass, field

from fastapi import Request
from redis import Redis
from redis.asyncio import Redis as AsyncRedis

from service.auth import ApiKeys
from service.followers import MOST, Followers
from service.health import Readiness
from service.limits import RateLimits
from service.metrics import Metrics
from service.probe import Inspector
from service.settings import Settings
from service.uploads import Intake
from worker.progress import Progress
from worker.queues import Queues, connect
from worker.records import Records
from worker.storage import Storage

PATIENCE_SECONDS = 2.0
"""How long a request waits for a Redis that is away before it is told to come back."""
SPARE_CONNECTIONS = 50
"""To Redis, beyond one for each stream of events: some have ended and are not known to have yet."""
STREAM_SECONDS = 10.0
"""After which a Redis that does not answer a stream of events is asked anew; it owes one every 2 s."""


@dataclass(frozen=True)
class Front:
    """What a front holds."""

    settings: Settings
    redis: Redis
    async_redis: AsyncRedis
    """For the streams of events, each of which waits most of the time."""
    keys: ApiKeys
    limits: RateLimits
    records: Records
    queues: Queues
    progress: Progress
    storage: Storage
    intake: Intake
    inspector: Inspector
    metrics: Metrics
    readiness: Readiness
    followers: Followers = field(default_factory=Followers)
    closing: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when the front is to end: streams of events end by themselves then."""

    @classmethod
    def open(cls, settings: Settings, metrics: Metrics) -> "Front":
        """Connect; nothing is asked of Redis yet."""
        client = connect(settings.redis_url, PATIENCE_SECONDS)
        records = Records(client)
        queues, storage = Queues(client, records), Storage(settings.store_url)
        intake = Intake(
            settings.staging, settings.max_upload_bytes, settings.min_free_bytes, settings.idle_seconds
        )
        return cls(
            settings=settings,
            redis=client,
            async_redis=AsyncRedis.from_url(
                settings.redis_url,
                decode_responses=True,
                max_connections=MOST + SPARE_CONNECTIONS,
                socket_timeout=STREAM_SECONDS,
                socket_connect_timeout=PATIENCE_SECONDS,
            ),
            keys=ApiKeys(client),
            limits=RateLimits(client, settings),
            records=records,
            queues=queues,
            progress=Progress(client),
            storage=storage,
            intake=intake,
            inspector=Inspector(settings.inspections),
            metrics=metrics,
            readiness=Readiness(client, queues, storage, intake),
        )

    async def close(self) -> None:
        """Give the connections back."""
        self.closing.set()
        await self.async_redis.aclose()
        self.queues.close()
        self.redis.close()


def front_of(request: Request) -> Front:
    """The front that serves this request (a dependency of the routes)."""
    front: Front = request.app.state.front
    return front
