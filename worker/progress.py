"""What a job tells while it works: events and log lines, kept in Redis until the job expires.

The events are written by the transitions themselves (`worker/lua`), in the same transaction: whoever follows
them sees every change of status, and the last event is the end.
"""

import asyncio
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import cast

import redis.asyncio
import redis.exceptions
from redis import Redis

from worker.record import FINAL
from worker.scripts import Scripts

LOG_LINES = 2000
"""Newest lines kept of a job's log."""
LINE_LENGTH = 2000
"""Characters kept of one line."""
BLOCK_S = 2.0
BEGINNING = "0"

Entries = list[tuple[str, dict[str, str]]]


@dataclass(frozen=True)
class Event:
    """A change of a job."""

    id: str
    """Where to resume: what a client sends back as Last-Event-ID."""
    status: str
    stage: str
    progress: float
    """0..100."""
    attempt: int
    at: datetime
    """UTC."""

    @property
    def final(self) -> bool:
        """Whether it is the last one."""
        return self.status in FINAL


class Progress:
    """Events and logs of all jobs.

    Args:
        redis: As `worker.queues.connect` makes it.
    """

    def __init__(self, redis: "Redis") -> None:
        """See the class."""
        self._redis = redis
        self._run = Scripts(redis)

    def read(self, job_id: str, after: str = BEGINNING) -> Sequence[Event]:
        """The events after the one with the id `after`."""
        newer = BEGINNING if after == BEGINNING else f"({after}"
        entries = cast(Entries, self._redis.xrange(f"matphys:events:{job_id}", newer, "+"))
        return [_event(*entry) for entry in entries]

    def follow(self, job_id: str, after: str = BEGINNING) -> Iterator[Event | None]:
        """The events after `after` as they come, the final one last; None every two seconds of silence.

        Ends without a final event when the job is deleted meanwhile, and when `after` is that event.
        """
        while True:
            # Asked first: what ends between the two questions is still told.
            status = self._redis.hget(f"matphys:job:{job_id}", "status")
            over = status is None or status in FINAL
            events = self.read(job_id, after) or ([] if over else self._wait(job_id, after))
            for event in events:
                yield event
                if event.final:
                    return
                after = event.id
            if not events:
                if over:  # nothing will come: it was deleted, or its end has been seen
                    return
                yield None

    def log(self, job_id: str, lines: Sequence[str]) -> None:
        """Append lines to the job's log; the oldest give way. That of a job that is gone stays gone."""
        if not lines:
            return
        short = [" ".join(line[:LINE_LENGTH].splitlines()) for line in lines]
        self._run("log", job_id, LOG_LINES, *short)

    def read_log(self, job_id: str) -> Sequence[str]:
        """The lines of the job's log."""
        return cast("list[str]", self._redis.lrange(f"matphys:log:{job_id}", 0, -1))

    def _wait(self, job_id: str, after: str) -> Sequence[Event]:
        answer = self._redis.xread({f"matphys:events:{job_id}": after}, block=round(1000 * BLOCK_S))
        return [_event(*entry) for entry in _entries(answer)]


async def follow(
    client: "redis.asyncio.Redis", job_id: str, after: str = BEGINNING
) -> AsyncIterator[Event | None]:
    """What `Progress.follow` gives, for an event loop.

    Args:
        client: Speaks text (`decode_responses=True`).
        job_id: Of the job.
        after: Id of the last event that was seen.
    """
    key = f"matphys:events:{job_id}"
    while True:
        try:
            # Asked first: what ends between the two questions is still told.
            status = await client.hget(f"matphys:job:{job_id}", "status")
            wait = None if status is None or status in FINAL else round(1000 * BLOCK_S)
            answer = await client.xread({key: after}, block=wait, count=100)
        except (redis.exceptions.ConnectionError, redis.exceptions.TimeoutError):
            await asyncio.sleep(0.5)
            yield None
            continue
        for event in (_event(*entry) for entry in _entries(answer)):
            yield event
            if event.final:
                return
            after = event.id
        if not answer:
            if wait is None:  # nothing will come: it was deleted, or its end has been seen
                return
            yield None


def _entries(answer: object) -> Entries:
    """The entries of the one stream that was asked for, in either protocol's form."""
    if not answer:
        return []
    if isinstance(answer, dict):
        (entries,) = answer.values()
        return cast(Entries, entries[0] if entries and isinstance(entries[0], list) else entries)
    (_, entries) = cast("list[tuple[str, Entries]]", answer)[0]
    return entries


def _event(entry_id: str, fields: dict[str, str]) -> Event:
    at = datetime.fromtimestamp(float(fields["at"]), UTC)
    progress, attempt = float(fields["progress"]), int(fields["attempt"])
    return Event(entry_id, fields["status"], fields["stage"], progress, attempt, at)
