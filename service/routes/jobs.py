"""What can be done with jobs of every kind: submit, list, look at, follow, cancel, delete, download."""

from collections.abc import AsyncIterator
from typing import Annotated, Any, TypedDict

from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import PlainTextResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent

from model.job_schema import EXAMPLE_ID, Job, JobPage, JobStatus
from service.access import Reader, Submitter
from service.cursors import CURSOR_PATTERN, decode_cursor
from service.downloads import send_file
from service.errors import ProblemError
from service.front import Front, front_of
from service.openapi import ACCEPTED, FILE_RESPONSES, describe_upload, problems
from service.resources import Resource
from service.submission import Submission, check_parent
from worker.progress import BEGINNING, Event, follow
from worker.record import JobRecord

FrontNow = Annotated[Front, Depends(front_of)]
JobId = Annotated[str, Path(alias="id", max_length=64, examples=[EXAMPLE_ID])]
IdempotencyKey = Annotated[
    str,
    Header(
        alias="Idempotency-Key",
        max_length=255,
        pattern=r"^[!-~]*$",
        description="Sent again with the same content, it gives the same job.",
        examples=["clip-0042"],
    ),
]
LOOK_AGAIN_SECONDS = 2
"""After which it is worth asking how a new job does."""


class Wanted(TypedDict):
    """Which jobs of a list: what `Records.list` is asked for."""

    status: JobStatus | None
    cursor: str | None
    limit: int


def wanted_of(
    status: Annotated[JobStatus | None, Query(description="Only those.")] = None,
    cursor: Annotated[
        str | None, Query(pattern=CURSOR_PATTERN, description="`next_cursor` of the page before.")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 20,
) -> Wanted:
    """As the query of a request says."""
    return Wanted(status=status, cursor=None if cursor is None else decode_cursor(cursor), limit=limit)


def job_routes(resource: Resource) -> APIRouter:
    """All routes of a kind of job: a further kind needs its `Resource`, and this line."""
    router = APIRouter(tags=[resource.path.strip("/")])
    if resource.parent is None:
        _add_submitting(router, resource)
    else:
        _add_submitting_to_parent(router, resource, resource.parent)
    _add_reading(router, resource)
    _add_watching(router, resource)
    _add_ending(router, resource)
    return router


def _add_submitting(router: APIRouter, resource: Resource) -> None:
    @router.post(resource.path, **_submitting(resource))
    async def submit(
        request: Request,
        response: Response,
        front: FrontNow,
        key: Submitter,
        idempotency_key: IdempotencyKey = "",
    ) -> Job:
        submission = Submission(key, resource, None, idempotency_key)
        record = await submission.accept_upload(front, request)
        return await run_in_threadpool(_accepted, request, response, front, resource, record)


def _add_submitting_to_parent(router: APIRouter, resource: Resource, parent: Resource) -> None:
    path = f"{parent.path}/{{id}}{resource.path}"

    def worked_on(job_id: JobId, front: FrontNow, key: Submitter) -> JobRecord:
        record = parent.find(front, key, job_id)
        check_parent(record, parent.noun)
        return record

    @router.post(path, **_submitting(resource, 404, 409))
    async def submit(
        request: Request,
        response: Response,
        front: FrontNow,
        key: Submitter,
        record: Annotated[JobRecord, Depends(worked_on)],
        idempotency_key: IdempotencyKey = "",
    ) -> Job:
        submission = Submission(key, resource, record, idempotency_key)
        accepted = await submission.accept_upload(front, request)
        return await run_in_threadpool(_accepted, request, response, front, resource, accepted)

    @router.get(path, summary=f"List those of one {parent.noun}, newest first", responses=problems(404))
    def list_children(
        job_id: JobId, front: FrontNow, key: Reader, wanted: Annotated[Wanted, Depends(wanted_of)]
    ) -> JobPage:
        job = parent.find(front, key, job_id)
        found, last = front.records.list_children(job.id, resource.kind.name, **wanted)
        return resource.page(front, found, last)


def _submitting(resource: Resource, *statuses: int) -> dict[str, Any]:
    """How a route that takes an upload describes itself."""
    return {
        "summary": f"Ask for a {resource.noun}",
        "status_code": 202,
        "responses": problems(400, 408, 413, 415, *statuses) | {202: ACCEPTED},
        "openapi_extra": describe_upload(resource.kind),
    }


def _accepted(
    request: Request, response: Response, front: Front, resource: Resource, record: JobRecord
) -> Job:
    request.scope["state"] |= {"job": record.id, "kind": record.kind}
    response.headers["Location"] = resource.url(record.id)
    response.headers["Retry-After"] = str(LOOK_AGAIN_SECONDS)
    return resource.job(front, record)


def _add_reading(router: APIRouter, resource: Resource) -> None:
    @router.get(resource.path, summary=f"List {resource.path[1:]}, newest first", responses=problems())
    def list_jobs(front: FrontNow, key: Reader, wanted: Annotated[Wanted, Depends(wanted_of)]) -> JobPage:
        found, last = front.records.list(key.tenant, resource.kind.name, **wanted)
        return resource.page(front, found, last)

    @router.get(resource.path + "/{id}", summary=f"A {resource.noun} as it stands", responses=problems(404))
    def show_job(job_id: JobId, request: Request, front: FrontNow, key: Reader) -> Job:
        request.scope["state"]["job"] = job_id
        return resource.job(front, resource.find(front, key, job_id))

    @router.get(
        resource.path + "/{id}/files/{name}",
        summary="Download a file",
        response_class=Response,
        responses=problems(404, 416) | FILE_RESPONSES,
    )
    def get_file(
        job_id: JobId,
        name: Annotated[str, Path(max_length=100, examples=["bundle.twin.zip"])],
        request: Request,
        front: FrontNow,
        key: Reader,
    ) -> Response:
        file = resource.find(front, key, job_id).file(name)
        if file is None:
            raise ProblemError("not-found", f"this {resource.noun} has no such file")
        return send_file(request, front.storage, file)


def _add_watching(router: APIRouter, resource: Resource) -> None:
    def followed(job_id: JobId, front: FrontNow, key: Reader) -> tuple[str, str]:
        """The job is looked up before the stream begins: an error is a problem then, not an event."""
        front.followers.check(key.id)
        return resource.find(front, key, job_id).id, key.id

    @router.get(
        resource.path + "/{id}/events",
        summary="Follow the events (SSE)",
        description="An event a change, the last one with a final status. `Last-Event-ID` resumes.",
        response_class=EventSourceResponse,
        responses=problems(404),
    )
    async def follow_job(
        job_and_key: Annotated[tuple[str, str], Depends(followed)],
        front: FrontNow,
        last_event_id: Annotated[
            str,
            Header(
                alias="Last-Event-ID",
                pattern=r"^\d{1,19}(-\d{1,19})?$",
                description="Id of the last event that was seen.",
            ),
        ] = BEGINNING,
    ) -> AsyncIterator[ServerSentEvent]:
        job_id, key_id = job_and_key
        with front.followers.one(key_id):
            async for event in follow(front.async_redis, job_id, last_event_id):
                if event is not None:
                    yield _sse(event)
                if front.closing.is_set():
                    return

    @router.get(
        resource.path + "/{id}/logs",
        summary="The log",
        response_class=PlainTextResponse,
        responses=problems(404) | {200: {"content": {"text/plain": {"example": "tracking: 300 points"}}}},
    )
    def get_log(job_id: JobId, front: FrontNow, key: Reader) -> PlainTextResponse:
        record = resource.find(front, key, job_id)
        return PlainTextResponse("".join(f"{line}\n" for line in front.progress.read_log(record.id)))


def _add_ending(router: APIRouter, resource: Resource) -> None:
    @router.post(resource.path + "/{id}/cancel", summary="Cancel", responses=problems(404, 409))
    def cancel_job(job_id: JobId, request: Request, front: FrontNow, key: Submitter) -> Job:
        record = resource.find(front, key, job_id)
        request.scope["state"]["job"] = record.id
        before = front.queues.cancel(record.id)
        if before in ("succeeded", "failed"):
            raise ProblemError("conflict", f"this {resource.noun} has {before} already")
        return resource.job(front, resource.find(front, key, job_id))

    @router.delete(
        resource.path + "/{id}", summary="Delete it and its files", status_code=204, responses=problems(404)
    )
    def delete_job(job_id: JobId, request: Request, front: FrontNow, key: Submitter) -> None:
        record = resource.find(front, key, job_id)
        request.scope["state"]["job"] = record.id
        front.queues.cancel(record.id)
        front.records.delete(record.id)


def _sse(event: Event) -> ServerSentEvent:
    data = {
        "status": event.status,
        "stage": event.stage or None,
        "progress": event.progress,
        "attempt": event.attempt,
        "at": event.at.isoformat().replace("+00:00", "Z"),
    }
    return ServerSentEvent(data=data, event="progress", id=event.id, retry=2000)
