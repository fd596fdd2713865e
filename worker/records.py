"""The state of every job in Redis, the single source of truth.

rq carries ids and starts processes; what a job is, how far it is and which attempt holds it is decided here,
in transactions (`worker/lua`). Only the newest attempt may change a running job, and final states never
change, so that two runs can never both publish.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, cast

from pydantic import JsonValue
from redis import Redis

from worker.record import JobError, JobFile, JobRecord, files_prefix, from_fields, to_fields
from worker.scripts import Scripts

LEASE_S = 8.0
"""How long a worker may be silent about a running job before it is suspected [s]; it speaks every second."""
GRACE_S = 4.0
"""How long a suspected worker has to speak up before its job is given to another [s]."""
MOST_CRASHES = 2
"""How often a job that crashed is tried again."""
RESERVED_S = 3600.0
"""How long an upload may lie in the store before a job claims it [s]."""
PAGE = 100


class Refused(Exception):
    """A new job was not accepted."""


class KeyReused(Refused):
    """The idempotency key came with other content before."""


class QueueFull(Refused):
    """As many jobs wait as may."""


class TenantBusy(Refused):
    """The tenant has as many jobs under way as it may."""


class ParentGone(Refused):
    """The job that it is to work on was deleted."""


class Fenced(Exception):
    """This attempt no longer holds the job: it was canceled, deleted, or given to another run."""


class Records:
    """All jobs in one Redis. A transition is one transaction, and may be repeated if its answer is lost."""

    def __init__(self, redis: "Redis") -> None:
        """`redis` as `worker.queues.connect` makes it."""
        self._redis = redis
        self._run = Scripts(redis)

    def reserve(self, job_id: str) -> None:
        """Say, before the first byte is stored, that files of this job may come: unclaimed ones are swept."""
        self._redis.zadd("matphys:garbage", {files_prefix(job_id): self._now() + RESERVED_S})

    def create(
        self,
        record: JobRecord,
        idempotency_key: str = "",
        *,
        most_queued: int = 1000,
        most_active: int = 100,
    ) -> tuple[JobRecord, bool]:
        """Accept a job; once this returns, no crash loses it.

        Args:
            record: Id, kind, queue, tenant, parent, inputs, options, digest, webhook, keep_s are taken.
            idempotency_key: Given by the client; "": none.
            most_queued: Jobs that may wait in the queue, all tenants together.
            most_active: Jobs of this kind a tenant may have waiting and running.

        Returns:
            The job, and whether it is new: not when the key or the content (digest) is known already. The
            files of a job that is not new are the caller's to delete (else the sweep does).

        Raises:
            KeyReused: the idempotency key belongs to other content.
            QueueFull, TenantBusy: try later.
            ParentGone: what it is to work on was deleted meanwhile.
        """
        key = hashlib.sha256(idempotency_key.encode()).hexdigest() if idempotency_key else ""
        happened, job_id = self._run.settled(
            "create",
            record.id,
            record.tenant,
            record.kind,
            record.queue,
            record.digest,
            key,
            int(record.keep_s),
            most_queued,
            most_active,
            *to_fields(record),
        )
        match happened:
            case "conflict":
                raise KeyReused(job_id)
            case "full":
                raise QueueFull(record.queue)
            case "busy":
                raise TenantBusy(record.tenant)
            case "orphan":
                raise ParentGone(record.parent or "")
        return self.get(job_id) or record, happened == "created"

    def get(self, job_id: str) -> JobRecord | None:
        """The job; None: there is none, or it has expired."""
        return from_fields(cast(dict[str, str], self._redis.hgetall(f"matphys:job:{job_id}")))

    def list(
        self,
        tenant: str,
        kind: str,
        *,
        status: str | None = None,
        cursor: str | None = None,
        limit: int = 20,
    ) -> tuple[Sequence[JobRecord], str | None]:
        """Jobs of a tenant, newest first, and the cursor of the next page (None: this is the last)."""
        return _page(self._after(tenant, kind, cursor), status, limit)

    def children(self, job_id: str) -> Sequence[JobRecord]:
        """Exports, diagnoses and the webhook of a job."""
        ids = cast(set[str], self._redis.smembers(f"matphys:children:{job_id}"))
        return [record for child in sorted(ids) if (record := self.get(child)) is not None]

    def list_children(
        self,
        job_id: str,
        kind: str,
        *,
        status: str | None = None,
        cursor: str | None = None,
        limit: int = 20,
    ) -> tuple[Sequence[JobRecord], str | None]:
        """Those of one kind that were made of a job, as `list` gives a tenant's."""
        newest = (
            record
            for record in reversed(self.children(job_id))
            if record.kind == kind and (cursor is None or record.id < cursor)
        )
        return _page(newest, status, limit)

    def cancel(self, job_id: str) -> str | None:
        """Cancel a job that has not ended; gives the status it had, None: no such job."""
        return cast("str | None", self._run("cancel", job_id))

    def delete(self, job_id: str) -> None:
        """Forget a job, its children and their files; what runs is stopped. None of it comes back."""
        with self._run.settling() as run:
            _forget(run, [job_id])

    def begin(self, job_id: str, token: str, worker: str) -> int | None:
        """Start an attempt; None: nothing to do (ended, deleted, running elsewhere, or not due yet).

        Args:
            job_id: Of the job.
            token: Names this run: the same token gets the same attempt again.
            worker: Who runs it.
        """
        attempt = self._run("begin", job_id, token, worker, LEASE_S)
        return None if attempt is None else int(attempt)

    def advance(
        self, job_id: str, attempt: int, stage: str, progress: float, ended: tuple[str, float] | None = None
    ) -> None:
        """Tell the stage at work, the progress 0..100, and the stage that ended with its seconds.

        Raises:
            Fenced: this attempt has lost the job; it must end and publish nothing.
        """
        stage_ended, seconds = ended or ("", 0.0)
        self._held(self._run("advance", job_id, attempt, stage, f"{progress:.1f}", stage_ended, seconds))

    def renew(self, job_id: str, attempt: int) -> bool:
        """Hold the job for another lease; False: it is no longer this attempt's."""
        return bool(self._run("renew", job_id, attempt, LEASE_S))

    def succeed(
        self,
        job_id: str,
        attempt: int,
        files: Sequence[JobFile],
        metrics: Mapping[str, JsonValue],
        ended: tuple[str, float] | None = None,
    ) -> None:
        """Publish: name the files of this attempt, and end the job.

        Raises:
            Fenced: this attempt has lost the job; its files are to be deleted.
            ValueError: a metric is not finite, which JSON cannot tell anybody.
        """
        stage, seconds = ended or ("", 0.0)
        named = json.dumps([file.model_dump() for file in files])
        answer = self._run.settled(
            "succeed", job_id, attempt, named, json.dumps(dict(metrics), allow_nan=False), stage, seconds
        )
        self._held(answer)

    def fail(self, job_id: str, attempt: int, error: JobError) -> None:
        """End the job without a result; trying again would not help.

        Raises:
            Fenced: this attempt has lost the job.
        """
        self._held(self._run("fail", job_id, attempt, error.model_dump_json()))

    def crash(self, job_id: str, attempt: int, error: JobError) -> str | None:
        """The attempt died: the job waits for another, or has failed with `error` after too many."""
        answer = self._run("release", job_id, attempt, 1.0, 1, MOST_CRASHES, error.model_dump_json())
        return cast("str | None", answer)

    def hand_back(self, job_id: str, attempt: int, delay_s: float = 0.0) -> str | None:
        """Give the job to whoever comes next, after `delay_s`: nobody is to blame."""
        return cast("str | None", self._run("release", job_id, attempt, delay_s, 0, 0, ""))

    def postpone(self, job_id: str, attempt: int, delay_s: float) -> str | None:
        """The same of one that was done, and wants to be done again after `delay_s`: that is counted."""
        return cast("str | None", self._run("release", job_id, attempt, delay_s, 0, 0, "", 1))

    def reap(self, error: JobError) -> dict[str, str]:
        """Take back the jobs of workers that died; id → their new status."""
        answer = self._run("reap", GRACE_S, 1.0, MOST_CRASHES, error.model_dump_json())
        return dict(zip(answer[::2], answer[1::2], strict=True))

    def due(self, queue: str, since_s: float = 0.0) -> Sequence[str]:
        """Ids of the jobs that wait in a queue and could have begun `since_s` ago, in order."""
        key, most = f"matphys:queued:{queue}", self._now() - since_s
        return cast("list[str]", self._redis.zrangebyscore(key, "-inf", most))

    def position(self, record: JobRecord) -> int | None:
        """How many jobs are before this one in its queue; None: it does not wait."""
        return cast("int | None", self._redis.zrank(f"matphys:queued:{record.queue}", record.id))

    def depth(self, queue: str) -> int:
        """How many jobs wait in a queue."""
        return self._redis.zcard(f"matphys:queued:{queue}")

    def running(self) -> int:
        """How many jobs run."""
        return self._redis.zcard("matphys:running")

    def expire(self) -> int:
        """Delete the jobs whose time is over (their files go with the next `garbage`); gives how many.

        One from which another is being made waits for that one.
        """
        ids = cast("list[str]", self._redis.zrangebyscore("matphys:expiry", "-inf", self._now(), 0, PAGE))
        gone = 0
        with self._run.settling() as run:
            for job_id in ids:
                children = run("expire", job_id)
                if children is not None:
                    gone += 1
                    _forget(run, children)
        return gone

    def garbage(self) -> Sequence[str]:
        """Prefixes in the store that nobody needs any more."""
        return cast("list[str]", self._redis.zrangebyscore("matphys:garbage", "-inf", self._now(), 0, PAGE))

    def swept(self, prefix: str) -> None:
        """The files below a prefix of `garbage` are gone."""
        self._redis.zrem("matphys:garbage", prefix)

    def _after(self, tenant: str, kind: str, cursor: str | None) -> Iterator[JobRecord]:
        key, newest = f"matphys:index:{tenant}:{kind}", "+" if cursor is None else f"({cursor}"
        while ids := cast("list[str]", self._redis.zrevrangebylex(key, newest, "-", 0, PAGE)):
            with self._redis.pipeline(transaction=False) as pipeline:
                for job_id in ids:
                    pipeline.hgetall(f"matphys:job:{job_id}")
                fields = pipeline.execute()
            yield from (record for each in fields if (record := from_fields(each)) is not None)
            newest = f"({ids[-1]}"

    def _held(self, answer: int) -> None:
        if not answer:
            raise Fenced

    def _now(self) -> float:
        seconds, micros = self._redis.time()
        return seconds + micros / 1e6


def _forget(run: Callable[..., Any], job_ids: Iterable[str]) -> None:
    """Jobs, and whatever was made of them."""
    left = list(job_ids)
    while left:
        left += run("delete", left.pop())


def _page(
    records: Iterable[JobRecord], status: str | None, limit: int
) -> tuple[Sequence[JobRecord], str | None]:
    """The first of some jobs, and the cursor of the next page (None: this is the last)."""
    found: list[JobRecord] = []
    for record in records:
        if status is None or record.status == status:
            if len(found) == limit:
                return found, found[-1].id
            found.append(record)
    return found, None
