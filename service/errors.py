"""Errors over HTTP: problem+json (RFC 9457), and nothing of our insides."""

import errno
import logging
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

import redis.exceptions
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.routing import Match

from model.errors import InputError
from model.job_schema import PROBLEM, Problem
from worker.storage import StorageError

MEDIA_TYPE = "application/problem+json"
RETRY_SECONDS = 5
"""What a client is told to wait when something of ours is briefly away."""

TITLES = {
    "bad-request": (400, "The request cannot be read"),
    "unauthorized": (401, "An API key is needed"),
    "forbidden": (403, "The API key does not allow this"),
    "not-found": (404, "Not found"),
    "method-not-allowed": (405, "Method not allowed"),
    "not-acceptable": (406, "Not acceptable"),
    "upload-stalled": (408, "The upload stalled"),
    "conflict": (409, "The job is not in a state that allows this"),
    "too-large": (413, "Too large"),
    "unsupported-media-type": (415, "Unsupported media type"),
    "range-not-satisfiable": (416, "Range not satisfiable"),
    "bad-input": (422, "The input cannot be used"),
    "invalid-request": (422, "The request does not hold what it must"),
    "key-reused": (422, "The Idempotency-Key was used for another request"),
    "too-many-requests": (429, "Too many requests"),
    "queue-full": (429, "Too many jobs are waiting"),
    "internal": (500, "Internal error"),
    "unavailable": (503, "Briefly unavailable"),
    "no-space": (503, "No space left for uploads"),
}
"""Every problem there is: its status and title."""

log = logging.getLogger("matphys.service")


class ProblemError(Exception):
    """A request that ends in a problem.

    Args:
        name: One of `TITLES`.
        detail: One line for the client: what was wrong, in which input, what to do.
        retry_after: Seconds after which another try may succeed.
        headers: Further headers of the answer.
        extensions: Further members of the problem.
    """

    def __init__(
        self,
        name: str,
        detail: str | None = None,
        *,
        retry_after: float | None = None,
        headers: Mapping[str, str] | None = None,
        **extensions: Any,  # noqa: ANN401 - whatever JSON can express
    ) -> None:
        """Look the name up, so that a wrong one fails where it is raised."""
        self.status, self.title = TITLES[name]
        self.name, self.detail, self.extensions = name, detail, extensions
        self.headers = dict(headers or {})
        if retry_after is not None:
            self.headers["Retry-After"] = str(max(1, round(retry_after + 0.5)))
        super().__init__(detail or self.title)


def answer(problem: ProblemError, request_id: str | None = None) -> JSONResponse:
    """The problem as a response."""
    content = Problem(
        type=PROBLEM + problem.name,
        title=problem.title,
        status=problem.status,
        detail=problem.detail,
        instance=None if request_id is None else f"urn:uuid:{request_id}",
    ).model_dump(mode="json", exclude_none=True)
    return JSONResponse(content | problem.extensions, problem.status, problem.headers, media_type=MEDIA_TYPE)


def translate(error: Exception) -> ProblemError:
    """The problem that tells a client about an error of whatever kind."""
    match error:
        case ProblemError():
            return error
        case RequestValidationError():
            return _validation(error)
        case HTTPException():
            return _http(error)
        case InputError():
            return ProblemError("bad-input", str(error))
        case redis.exceptions.RedisError() | StorageError() | ConnectionError() | TimeoutError():
            return ProblemError("unavailable", "try again shortly", retry_after=RETRY_SECONDS)
        case OSError() if error.errno in (errno.ENOSPC, errno.EDQUOT):
            return ProblemError("no-space", "try again later", retry_after=60)
    return ProblemError("internal", "the error was logged; its number is the instance of this problem")


def install(app: FastAPI) -> None:
    """Make every error of the app a problem."""

    async def handle(request: Request, error: Exception) -> JSONResponse:
        problem = translate(error)
        if problem.status == 405:
            problem.headers["Allow"] = ", ".join(_methods(request))
        if problem.status >= 500 and problem is not error:  # one of ours says all there is to say
            log.error("request failed", exc_info=error, extra={"problem": problem.name})
        return answer(problem, request.scope.get("state", {}).get("request_id"))

    for kind in (ProblemError, RequestValidationError, HTTPException, InputError, Exception):
        app.add_exception_handler(kind, handle)
    for kind in (redis.exceptions.RedisError, StorageError, OSError):
        app.add_exception_handler(kind, handle)


def _methods(request: Request) -> list[str]:
    """What may be done at a path; the router names the methods of the first route there alone."""
    routes = request.app.router.routes
    scopes = {name: {**request.scope, "method": name} for name in ("GET", "HEAD", "POST", "DELETE")}
    return [
        name
        for name, scope in scopes.items()
        if any(route.matches(scope)[0] is Match.FULL for route in routes)
    ]


def _validation(error: RequestValidationError) -> ProblemError:
    """Each field and what is wrong with it; what was sent is not repeated."""
    entries = [
        {"field": ".".join(str(step) for step in entry["loc"]), "message": _message(entry)}
        for entry in error.errors()[:20]
    ]
    first = entries[0] if entries else {"field": "request", "message": "is not valid"}
    return ProblemError("invalid-request", f"{first['field']}: {first['message']}", errors=entries)


def _message(entry: Mapping[str, Any]) -> str:
    message = str(entry["msg"]).removeprefix("Value error, ")
    return message[:1].lower() + message[1:200]


def _http(error: HTTPException) -> ProblemError:
    """What the framework itself refuses: unknown paths, methods, bodies it cannot read."""
    names = {status: name for name, (status, _) in reversed(TITLES.items())}
    name = names.get(error.status_code, "bad-request" if error.status_code < 500 else "internal")
    phrase = HTTPStatus(error.status_code).phrase
    detail = error.detail if error.detail != phrase and error.status_code < 500 else None
    return ProblemError(name, detail, headers=error.headers)
