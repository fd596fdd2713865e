"""The page and what it loads: the same for everyone, so it needs no key; the API it calls does."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources

from fastapi import APIRouter, Request, Response
from jinja2 import Environment, PackageLoader, StrictUndefined

from service.errors import ProblemError
from service.pages.offers import Format, Offer

MEDIA_TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data: blob:",
        "media-src blob:",
        "connect-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )
)
"""Nothing from elsewhere, nothing inline; previews and overlays come through the script, with the key."""


def page_router(
    twin: Offer, children: Sequence[Offer] = (), formats: Sequence[Format] = (), upload_limit: str = ""
) -> APIRouter:
    """The page at `/` and its files at `/static`.

    Args:
        twin: The form for a new twin.
        children: Further kinds of job, started on a twin that is done.
        formats: What a twin can be exported to.
        upload_limit: The largest clip, for people: `500 MB`.
    """
    files = {file.name: file.read_bytes() for file in (resources.files("service.pages") / "static").iterdir()}
    version = hashlib.sha256(b"".join(files[name] for name in sorted(files))).hexdigest()[:12]
    page = _render(twin, children, formats, upload_limit, version)
    router = APIRouter(include_in_schema=False)

    @router.get("/")
    def show_page(request: Request) -> Response:
        return _answer(request, page, "text/html", "no-cache")

    # The version is part of the path: scripts that import each other are of one version, and kept for good.
    @router.get("/static/{asked}/{name}")
    def show_file(request: Request, asked: str, name: str) -> Response:
        content = files.get(name)
        if content is None:
            raise ProblemError("not-found", "there is no such file")
        keep = "public, max-age=31536000, immutable" if asked == version else "no-cache"
        return _answer(request, content, MEDIA_TYPES[name[name.rindex(".") :]], keep)

    return router


def _render(
    twin: Offer, children: Sequence[Offer], formats: Sequence[Format], upload_limit: str, version: str
) -> bytes:
    environment = Environment(
        loader=PackageLoader("service.pages"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.globals["asset"] = lambda name: f"/static/{version}/{name}"
    form = replace(twin, files=tuple(file for file in twin.files if file.name != twin.main))
    return (
        environment.get_template("index.html")
        .render(twin=form, children=children, formats=formats, limit=upload_limit)
        .encode()
    )


def _answer(request: Request, content: bytes, media_type: str, keep: str) -> Response:
    """The content, or 304 to who has it."""
    tag = f'"{hashlib.sha256(content).hexdigest()[:16]}"'
    headers = {
        "Content-Security-Policy": CONTENT_SECURITY_POLICY,
        "Cache-Control": keep,
        "ETag": tag,
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
    }
    if request.headers.get("If-None-Match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(content, headers=headers, media_type=media_type)
