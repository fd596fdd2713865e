"""A request for a job becomes a job: read, looked into, stored, accepted."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import JsonValue, ValidationError

from model.version import __version__
from service.auth import ApiKey
from service.errors import ProblemError
from service.front import Front
from service.resources import Resource
from service.settings import MEBIBYTE
from service.uploads import listen_on
from worker.record import JobRecord, files_prefix, new_id
from worker.records import KeyReused, ParentGone, QueueFull, TenantBusy

FULL_SECONDS: Final = 30
"""What a client is told to wait when the queue is full."""
LIMITS: Final = {
    "camera": MEBIBYTE,
    "image": 64 * MEBIBYTE,
    "controllers": 64 * MEBIBYTE,
    "observation": 256 * MEBIBYTE,
    "mesh": 200_000_000,
    "depth": 200_000_000,
}
"""Largest file by its inspection [bytes]; those not named may be as large as the request."""


@dataclass(frozen=True)
class Submission:
    """Who wants what.

    Args:
        key: Of the request; a job belongs to its tenant.
        resource: What is asked for.
        parent: The job to work on; None: it needs none.
        idempotency_key: "": none.
    """

    key: ApiKey
    resource: Resource
    parent: JobRecord | None = None
    idempotency_key: str = ""

    async def accept_upload(self, front: Front, request: Request) -> JobRecord:
        """Take the body of a request in and accept the job it describes; a known one is given again.

        Raises:
            ProblemError: the request cannot be taken, or not now.
            RequestValidationError: an option is none, or not as it must be.
        """
        try:
            return await self._accept_upload(front, request)
        except (ProblemError, RequestValidationError):
            await listen_on(request)
            raise

    async def _accept_upload(self, front: Front, request: Request) -> JobRecord:
        await run_in_threadpool(self._check_first, front)
        inputs = self.resource.kind.inputs
        largest = front.settings.max_upload_bytes
        limits = {name: min(LIMITS.get(each.inspection, largest), largest) for name, each in inputs.items()}
        async with front.intake.receive(request, limits) as upload:
            chosen = _merge(request, upload.fields)
            record = self.record(front, chosen, {name: file.sha256 for name, file in upload.files.items()})
            missing = [
                name
                for name, each in inputs.items()
                if each.required and not {name, each.instead} & upload.files.keys()
            ]
            if missing:
                other = inputs[missing[0]].instead
                how = f"send it, or a {other} in its place" if other else "send it as the body, or in a form"
                raise ProblemError("bad-input", f"{missing[0]} is missing: {how}")
            for name, each in inputs.items():
                if {name, each.instead} <= upload.files.keys():
                    raise ProblemError("bad-input", f"{name} and {each.instead} are there: send one of them")
                if name in upload.files and each.beside and each.beside not in upload.files:
                    raise ProblemError("bad-input", f"{name} is there without {each.beside}: send both")
            for option, name in self.resource.kind.about.items():
                usual = self.resource.kind.options.model_fields[option].default
                if name not in upload.files and record.options[option] != usual:
                    raise ProblemError("bad-input", f"{option} is about a {name}, and none is there")
            looked_at = {name: (inputs[name].inspection, file.path) for name, file in upload.files.items()}
            suffixes = await front.inspector.inspect(self.key.tenant, looked_at)
            paths = {name: (file.path, suffixes[name]) for name, file in upload.files.items()}
            accepted = await run_in_threadpool(self.accept, front, record, paths)
            front.metrics.upload(sum(file.bytes for file in upload.files.values()))
            return accepted

    def record(self, front: Front, chosen: Mapping[str, str], hashes: Mapping[str, str]) -> JobRecord:
        """The job that is asked for; nothing knows of it yet.

        Args:
            front: Says how long jobs are kept.
            chosen: Options as text.
            hashes: Name of each input → its sha256.

        Raises:
            RequestValidationError: an option is none, or not as it must be.
        """
        kind = self.resource.kind
        try:
            options = kind.options.model_validate(dict(chosen))
        except ValidationError as error:
            raise RequestValidationError(error.errors(include_url=False, include_context=False)) from None
        values: dict[str, JsonValue] = options.model_dump(mode="json", exclude={"webhook"})
        webhook = getattr(options, "webhook", None)
        parent = None if self.parent is None else self.parent.id
        # What was chosen, without what was not: an upgrade that brings another option changes no request.
        chosen_only = options.model_dump(mode="json", exclude_defaults=True)
        content = [kind.name, parent, chosen_only, dict(sorted(hashes.items()))]
        request_hash = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        return JobRecord(
            id=new_id(),
            kind=kind.name,
            queue=kind.queue,
            tenant=self.key.tenant if self.parent is None else self.parent.tenant,
            parent=parent,
            options=values,
            webhook=webhook,
            keep_s=front.settings.retention_hours * 3600,
            digest=f"{request_hash}-{__version__}",
        )

    def accept(
        self, front: Front, record: JobRecord, files: Mapping[str, tuple[Path, str]] | None = None
    ) -> JobRecord:
        """Store the files (path and suffix of each) and accept the job; once this returns, nothing loses it.

        Raises:
            ProblemError: too many jobs wait, or the idempotency key belongs to another request.
        """
        prefix = files_prefix(record.id)
        if files:
            front.records.reserve(record.id)
        inputs = {name: f"{prefix}input/{name}{suffix}" for name, (_, suffix) in (files or {}).items()}
        try:
            for name, (path, _) in (files or {}).items():
                front.storage.publish(inputs[name], path)
            accepted, new = self._create(front, record.model_copy(update={"inputs": inputs}))
        except ProblemError:
            front.storage.delete(prefix)
            raise
        if new:
            front.queues.enqueue(accepted)
        elif inputs:
            front.storage.delete(prefix)
        return accepted

    def _create(self, front: Front, record: JobRecord) -> tuple[JobRecord, bool]:
        limits = front.settings
        try:
            return front.records.create(
                record,
                self.idempotency_key,
                most_queued=limits.max_jobs,
                most_active=limits.max_jobs_per_tenant,
            )
        except KeyReused:
            raise ProblemError("key-reused", "choose another key for another request") from None
        except QueueFull:
            raise _full() from None
        except TenantBusy:
            detail = f"at most {limits.max_jobs_per_tenant} of your jobs may wait or run"
            raise ProblemError("queue-full", detail, retry_after=FULL_SECONDS) from None
        except ParentGone:
            raise ProblemError("not-found", "what it is to work on was deleted meanwhile") from None

    def _check_first(self, front: Front) -> None:
        """What can be refused before a byte of the body is read."""
        front.limits.count("submission", self.key.id)
        if front.records.depth(self.resource.kind.queue) >= front.settings.max_jobs:
            raise _full()


def _full() -> ProblemError:
    return ProblemError("unavailable", "too many jobs wait", retry_after=FULL_SECONDS)


def _merge(request: Request, fields: Mapping[str, str]) -> dict[str, str]:
    """Options of the query, and of the form, which goes before."""
    pairs = request.query_params.multi_items()
    chosen = dict(pairs)
    if len(chosen) < len(pairs):
        raise ProblemError("invalid-request", "an option is given twice in the query")
    return chosen | dict(fields)


def check_parent(parent: JobRecord, noun: str) -> None:
    """Refuse to work on a job that has no result.

    Raises:
        ProblemError: it has not succeeded (yet).
    """
    if parent.status in ("queued", "running"):
        raise ProblemError("conflict", f"the {noun} is not done yet: wait for it", retry_after=5)
    if parent.status != "succeeded":
        ended = "was canceled" if parent.status == "canceled" else "has failed"
        raise ProblemError("conflict", f"the {noun} {ended}: there is nothing to work on")
