"""Twins: a clip goes in, a simulatable twin comes out, in the formats of other programs too."""

from datetime import UTC, datetime
from typing import Annotated

from fastapi import Path, Request, Response
from fastapi.responses import JSONResponse

from model.job_schema import Job
from service.access import Reader
from service.auth import ApiKey
from service.downloads import send_file
from service.errors import ProblemError
from service.front import Front
from service.openapi import ACCEPTED, FILE_RESPONSES, problems
from service.resources import Resource
from service.routes.jobs import FrontNow, JobId, job_routes
from service.submission import Submission, check_parent
from worker.kinds.export import FORMATS, ExportKind
from worker.kinds.twin import TwinKind
from worker.record import JobRecord

TRY_AGAIN_SECONDS = 60.0
"""After which an export that failed is tried again when asked for."""
LOOK_AGAIN_SECONDS = 1
"""After which an export is probably made."""

TWINS = Resource(TwinKind, "/twins", "twin")
EXPORTS = Resource(ExportKind, "/exports", "export", parent=TWINS)

router = job_routes(TWINS)


@router.get(
    "/twins/{id}/exports/{format}",
    summary="The twin in the format of another program",
    description="Made when it is first asked for: 202 until it is there, then the file.",
    response_class=Response,
    responses=problems(404, 409, 416) | FILE_RESPONSES | {202: ACCEPTED | {"model": Job}},
)
def export(
    job_id: JobId,
    name: Annotated[str, Path(alias="format", json_schema_extra={"enum": list(FORMATS)})],
    request: Request,
    front: FrontNow,
    key: Reader,
) -> Response:
    """Give the export, or start to make it."""
    twin = TWINS.find(front, key, job_id)
    if name not in FORMATS:
        raise ProblemError("not-found", f"there is no such format: choose one of {', '.join(FORMATS)}")
    check_parent(twin, TWINS.noun)
    made = _newest_export(front, twin, name) or _start_export(front, key, twin, name)
    if made.status == "succeeded":
        return send_file(request, front.storage, made.files[0])
    if made.status in ("queued", "running"):
        job = EXPORTS.job(front, made).model_copy(update={"urls": {"self": str(request.url.path)}})
        headers = {"Location": request.url.path, "Retry-After": str(LOOK_AGAIN_SECONDS)}
        return JSONResponse(job.model_dump(mode="json"), 202, headers)
    raise _failure(made)


def _newest_export(front: Front, twin: JobRecord, name: str) -> JobRecord | None:
    """The one that is made or being made; None: there is none worth waiting for."""
    exports = [
        record
        for record in front.records.children(twin.id)
        if record.kind == ExportKind.name and record.options.get("format") == name
    ]
    newest = max(exports, key=lambda record: record.id, default=None)
    return None if newest is None or _worth_another_try(newest) else newest


def _worth_another_try(made: JobRecord) -> bool:
    if made.status == "failed" and made.completed_at is not None:
        return (datetime.now(UTC) - made.completed_at).total_seconds() > TRY_AGAIN_SECONDS
    return made.status == "canceled"


def _failure(made: JobRecord) -> ProblemError:
    name = "bad-input" if made.error is not None and made.error.type == "bad-input" else "internal"
    return ProblemError(name, None if made.error is None else made.error.detail)


def _start_export(front: Front, key: ApiKey, twin: JobRecord, name: str) -> JobRecord:
    submission = Submission(key, EXPORTS, twin)
    return submission.accept(front, submission.record(front, {"format": name}, {}))
