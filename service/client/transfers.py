"""What the client sends and fetches: uploads that start jobs, pages of jobs, files."""

import hashlib
import os
import uuid
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
from pydantic import ValidationError

from model.job_schema import Job, JobPage, JobRequest, JobStatus
from service.client.transport import ServiceError, Transport, retry_after

PAGE = 100
"""Jobs asked for at once."""
POLL_S = 1.0
"""Between two looks at an export when nobody says how long [s]."""


def start_job(
    transport: Transport,
    url: str,
    files: Mapping[str, Path],
    request: JobRequest | None,
    idempotency_key: str | None,
) -> Job:
    """Upload the inputs of a job. With its key the upload may be tried again and is still one job.

    Raises:
        ServiceError: refused, or not reached.
        OSError: a file cannot be read.
    """
    fields = {} if request is None else request.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    texts = {name: _text(value) for name, value in fields.items()}

    def body(stack: ExitStack) -> Mapping[str, Any]:
        opened = {name: (path.name, stack.enter_context(path.open("rb"))) for name, path in files.items()}
        return {"data": texts, "files": opened}

    headers = {"Idempotency-Key": idempotency_key or str(uuid.uuid4())}
    return read_job(transport.request("POST", url, headers=headers, body=body, repeatable=True))


def read_job(response: httpx.Response) -> Job:
    """The job an answer holds.

    Raises:
        ServiceError: it holds none, so whoever answered is not this service.
    """
    try:
        return Job.model_validate_json(response.content)
    except ValidationError:
        raise _foreign(response) from None


def all_jobs(transport: Transport, url: str, status: JobStatus | None = None) -> Iterator[Job]:
    """The jobs of a collection, newest first, page by page as they are asked for."""
    params: dict[str, str | int] = {"limit": PAGE} | ({} if status is None else {"status": status})
    while True:
        response = transport.request("GET", url, params=params)
        try:
            page = JobPage.model_validate_json(response.content)
        except ValidationError:
            raise _foreign(response) from None
        yield from page.items
        if page.next_cursor is None:
            return
        params["cursor"] = page.next_cursor


def fetch(transport: Transport, url: str, path: Path, sha256: str | None = None) -> float | None:
    """Download a file; `path` then holds all of it or what it held before.

    A connection that breaks off is resumed where it broke.

    Returns:
        None; or, when the service still makes it, the seconds to wait before the next try.

    Raises:
        ServiceError: refused, not reached, or other bytes than `sha256` says.
    """
    part = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    tag: list[str] = []

    def attempt() -> float | None:
        done = part.stat().st_size if tag and part.exists() else 0
        headers = {"Accept-Encoding": "identity"}
        headers |= {"Range": f"bytes={done}-", "If-Range": tag[0]} if done else {}
        with transport.stream(url, headers) as response:
            if response.status_code == httpx.codes.ACCEPTED:
                return POLL_S if (wait := retry_after(response)) is None else wait
            resumed = response.status_code == httpx.codes.PARTIAL_CONTENT
            tag[:] = [response.headers["ETag"]] if "ETag" in response.headers else []
            with part.open("ab" if resumed else "wb") as file:
                for piece in response.iter_bytes():
                    file.write(piece)
        return None

    try:
        wait = transport.patiently(attempt)
        if wait is None:
            _verify(part, url, sha256)
            os.replace(part, path)
        return wait
    finally:
        part.unlink(missing_ok=True)


def _verify(part: Path, url: str, sha256: str | None) -> None:
    if sha256 is None:
        return
    with part.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != sha256:
        raise ServiceError("The download is damaged", f"{url}: expected sha256 {sha256}, found {found}")


def _text(value: object) -> str:
    """An option as the form has it; a box is `x,y,width,height`."""
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _foreign(response: httpx.Response) -> ServiceError:
    return ServiceError(
        "The answer is not one of this service",
        f"{response.url}: is it the address of matphys-serve?",
        status=response.status_code,
    )
