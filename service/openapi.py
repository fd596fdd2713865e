"""What the OpenAPI document says beyond what FastAPI finds out: problems, uploads, examples."""

from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from model.job_schema import PROBLEM, Problem
from model.version import __version__
from service.downloads import MEDIA_TYPES, OTHER_MEDIA_TYPE
from service.errors import MEDIA_TYPE, TITLES
from worker.kinds.base import Kind

DESCRIPTION = """Upload a clip of a soft object being handled, watch it become a simulatable twin,
download it.

Every request but those for the page and for health carries `Authorization: Bearer KEY`. Errors are
`application/problem+json` (RFC 9457). A `POST` may carry an `Idempotency-Key`: sent again with the same
content, it gives the same job; with other content, it is refused. Times are RFC 3339, UTC.
"""
BINARY = {"type": "string", "format": "binary"}
RETRY_AFTER = {
    "description": "Seconds to wait before the next try.",
    "schema": {"type": "integer", "minimum": 1},
}


ACCEPTED: dict[str, Any] = {
    "description": "Accepted: nothing loses it from here on",
    "headers": {
        "Location": {"description": "Where the job is.", "schema": {"type": "string"}},
        "Retry-After": RETRY_AFTER,
    },
}

ANY_FILE: dict[str, Any] = {
    media_type.partition(";")[0]: {} if media_type.endswith("json") else {"schema": BINARY}
    for media_type in (OTHER_MEDIA_TYPE, *MEDIA_TYPES.values())
}
FILE_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"description": "The file", "content": ANY_FILE},
    206: {"description": "The part of it that was asked for", "content": ANY_FILE},
    304: {"description": "Not changed"},
}


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The `responses` of a route that may answer with these problems, besides those that every route has."""
    return {status: _problem(status) for status in (*statuses, 401, 403, 422, 429, 500, 503)}


def public_problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The same for a route that needs no key."""
    return {status: _problem(status) for status in (*statuses, 422, 500)}


def _problem(status: int) -> dict[str, Any]:
    examples = {
        name: {"value": {"type": PROBLEM + name, "title": title, "status": status}}
        for name, (found, title) in TITLES.items()
        if found == status
    }
    response: dict[str, Any] = {
        "description": HTTPStatus(status).phrase,
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": examples}},
    }
    if status in (429, 503):
        response["headers"] = {"Retry-After": RETRY_AFTER}
    return response


def required_inputs(kind: type[Kind]) -> list[str]:
    """The files without which there is no job of this kind."""
    return [name for name, each in kind.inputs.items() if each.required and not each.instead]


def describe_upload(kind: type[Kind]) -> dict[str, Any]:
    """The `openapi_extra` of a route that takes the inputs and options of a kind of job."""
    options = {
        name: _plain(schema) for name, schema in kind.options.model_json_schema()["properties"].items()
    }
    main, required = next(iter(kind.inputs)), required_inputs(kind)
    form = {
        "type": "object",
        "required": required,
        "properties": {name: BINARY for name in kind.inputs} | options,
        "additionalProperties": False,
    }
    return {
        "parameters": [
            {"name": name, "in": "query", "required": False, "schema": schema}
            for name, schema in options.items()
        ],
        "requestBody": {
            "required": True,
            "description": f"The {main} itself, or a form with it and what belongs to it. "
            "Fields of the form go before the query.",
            "content": {
                "multipart/form-data": {"schema": form},
                "application/octet-stream": {"schema": BINARY},
                "video/mp4": {"schema": BINARY},
            },
        },
    }


def _plain(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema of a text: in a query or a form there is no null, and what is left out has its default."""
    plain = {name: value for name, value in schema.items() if name not in ("anyOf", "default", "title")}
    for choice in schema.get("anyOf", ()):
        if choice.get("type") != "null":
            plain |= choice
    if schema.get("default") is not None:
        plain["default"] = schema["default"]
    if "examples" in plain:
        plain["examples"] = [example for example in plain["examples"] if example is not None]
    return plain


def describe(app: FastAPI) -> dict[str, Any]:
    """The OpenAPI document of the app, made once."""
    if app.openapi_schema is None:
        document = get_openapi(
            title="MatPhys", version=__version__, description=DESCRIPTION, routes=app.routes
        )
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        schemas["Problem"] = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        app.openapi_schema = document
    return app.openapi_schema
