"""How jobs of a kind look over HTTP: where they are, and their JSON."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import cast

from model.job_schema import PROBLEM, Job, JobError, JobFile, JobPage
from service.auth import ApiKey
from service.cursors import JOB_ID, encode_cursor
from service.errors import ProblemError
from service.front import Front
from worker.kinds.base import Kind
from worker.record import JobRecord


@dataclass(frozen=True)
class Resource:
    """A kind of job and its place."""

    kind: type[Kind]
    path: str
    """Of the collection: `/twins`."""
    noun: str
    """For messages: `twin`."""
    parent: "Resource | None" = None
    """What it works on: then it is submitted below that, at `/twins/{id}/diagnoses`."""
    title: str = ""
    """What the page calls it; "": as its kind."""
    help: str = ""
    """A sentence for the page."""

    def url(self, job_id: str) -> str:
        """Of one job."""
        return f"{self.path}/{job_id}"

    def find(self, front: Front, key: ApiKey, job_id: str) -> JobRecord:
        """The job, if the key may know of it.

        Raises:
            ProblemError: not found; the same whether there is none or it is another tenant's.
        """
        record = front.records.get(job_id) if JOB_ID.fullmatch(job_id) else None
        if record is None or record.kind != self.kind.name or not _may_see(key, record):
            raise ProblemError("not-found", f"there is no such {self.noun}")
        return record

    def job(self, front: Front, record: JobRecord) -> Job:
        """The public JSON of a job."""
        url = self.url(record.id)
        urls = {"self": url} | {name: f"{url}/{name}" for name in ("events", "logs", "cancel")}
        return Job(
            id=record.id,
            kind=record.kind,
            status=record.status,
            stage=record.stage or None,
            progress=record.progress,
            queue_position=front.queues.position(record),
            created_at=cast(datetime, record.created_at),  # set by the transition that accepted it
            started_at=record.started_at,
            completed_at=record.completed_at,
            expires_at=record.expires_at,
            parent=record.parent,
            options=record.options,
            error=_error(record),
            metrics=record.metrics,
            files=tuple(
                JobFile(name=file.name, bytes=file.bytes, sha256=file.sha256, url=f"{url}/files/{file.name}")
                for file in record.files
            ),
            urls=urls,
            webhook=record.webhook,
        )

    def page(self, front: Front, records: Iterable[JobRecord], last: str | None) -> JobPage:
        """The public JSON of some jobs."""
        items = tuple(self.job(front, record) for record in records)
        return JobPage(items=items, next_cursor=None if last is None else encode_cursor(last))


def _error(record: JobRecord) -> JobError | None:
    error = record.error
    if error is None:
        return None
    return JobError(type=PROBLEM + error.type, title=error.title, detail=error.detail)


def _may_see(key: ApiKey, record: JobRecord) -> bool:
    return record.tenant == key.tenant or "admin" in key.scopes
