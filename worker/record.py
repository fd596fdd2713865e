"""One job as it stands, and how Redis keeps it: a hash of text."""

import json
import secrets
import time
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, JsonValue

Status: TypeAlias = Literal["queued", "running", "succeeded", "failed", "canceled"]
FINAL: frozenset[str] = frozenset({"succeeded", "failed", "canceled"})


class JobError(BaseModel):
    """Why a job failed, for its owner: nothing of the machine it ran on."""

    model_config = ConfigDict(frozen=True)

    type: str
    """`bad-input`, `out-of-memory`, `timeout`, `crash`, ..."""
    title: str
    detail: str


class JobFile(BaseModel):
    """One file a job published."""

    model_config = ConfigDict(frozen=True)

    name: str
    bytes: int
    sha256: str
    key: str
    """Where `worker.storage` has it."""


class JobRecord(BaseModel):
    """One job as it stands. Times are UTC, by the clock of Redis."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    id: str
    kind: str
    queue: str
    tenant: str
    parent: str | None = None
    """The job whose result this one works on, of an export or a diagnosis."""
    status: Status = "queued"
    stage: str = ""
    progress: float = 0.0
    """0..100."""
    attempt: int = 0
    """How many runs have begun; the newest one holds the job."""
    crashes: int = 0
    postponed: int = 0
    """How many runs have asked for another one."""
    created_at: datetime | None = None
    started_at: datetime | None = None
    """Of the newest attempt."""
    completed_at: datetime | None = None
    expires_at: datetime | None = None
    """When the job and its files are deleted; known once it has ended."""
    keep_s: float = 7 * 86400.0
    """How long they are kept after that end [s]."""
    error: JobError | None = None
    metrics: dict[str, JsonValue] = {}
    webhook: str | None = None
    """URL that is told about the end."""
    options: dict[str, JsonValue] = {}
    inputs: dict[str, str] = {}
    """Name of the input → key in the store."""
    files: tuple[JobFile, ...] = ()
    digest: str = ""
    """Hash of the request (inputs and options), a dash, and the software; "": not to be found again."""

    @property
    def final(self) -> bool:
        """Whether it has ended."""
        return self.status in FINAL

    def file(self, name: str) -> JobFile | None:
        """The published file of that name."""
        return next((file for file in self.files if file.name == name), None)


def new_id() -> str:
    """A job's id: 32 hex digits, sorted by time [ns], not to be guessed."""
    return f"{time.time_ns():016x}{secrets.token_hex(8)}"


def files_prefix(job_id: str) -> str:
    """Where everything of a job lies in the store; inputs under `input/`, results under their attempt."""
    return f"jobs/{job_id}/"


_JSON = ("error", "metrics", "options", "inputs", "files")
_TIMES = ("created_at", "started_at", "completed_at", "expires_at")


def to_fields(record: JobRecord) -> Iterator[str]:
    """The fields a new job brings, as name, value, name, ..."""
    given = record.model_dump(
        mode="json",
        include={
            "id",
            "kind",
            "queue",
            "tenant",
            "parent",
            "keep_s",
            "webhook",
            "options",
            "inputs",
            "digest",
        },
    )
    for name, value in given.items():
        if value is not None:
            yield name
            yield json.dumps(value) if name in _JSON else str(value)


def from_fields(fields: Mapping[str, str]) -> JobRecord | None:
    """The job a hash describes; None: the hash is empty."""
    if "id" not in fields:
        return None
    values: dict[str, Any] = dict(fields)
    for name in _JSON:
        if name in values:
            values[name] = json.loads(values[name])
    for name in _TIMES:
        if name in values:
            values[name] = datetime.fromtimestamp(float(values[name]), UTC)
    return JobRecord.model_validate(values)
