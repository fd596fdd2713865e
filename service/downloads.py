"""Files over HTTP: validators, ranges, names."""

import re
from typing import Final

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from service.errors import ProblemError
from worker.record import JobFile
from worker.storage import Storage

MEDIA_TYPES: Final = {
    "zip": "application/zip",
    "mp4": "video/mp4",
    "json": "application/json",
    "png": "image/png",
    "html": "text/html; charset=utf-8",
}
"""By suffix."""
OTHER_MEDIA_TYPE: Final = "application/octet-stream"
SHOWN: Final = ("mp4", "json", "png")
"""What a browser may show in place; nothing that can hold a script."""


def send_file(request: Request, storage: Storage, file: JobFile) -> Response:
    """A file, or the part of it the request asks for.

    Conditional requests (`If-None-Match`, `If-Range`) compare the sha256; one range is served, several are
    answered with the whole.

    Raises:
        ProblemError: the range lies outside, or the file is gone.
    """
    suffix = file.name.rpartition(".")[2]
    tag = f'"{file.sha256}"'
    headers = {
        "ETag": tag,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, no-cache",
        "Content-Disposition": f'{"inline" if suffix in SHOWN else "attachment"}; filename="{file.name}"',
        "Content-Security-Policy": "default-src 'none'; sandbox",
    }
    if _matches(request.headers.get("if-none-match"), tag):
        return Response(status_code=304, headers=headers)
    start, end, status = 0, file.bytes, 200
    # RFC 9110, section 14.2: a Range is about GET alone.
    if request.method == "GET" and request.headers.get("if-range", tag) == tag:
        wanted = _range(request.headers.get("range"), file.bytes)
        if wanted is not None:
            start, end, status = *wanted, 206
            headers["Content-Range"] = f"bytes {start}-{end - 1}/{file.bytes}"
    headers["Content-Length"] = str(end - start)
    media_type = MEDIA_TYPES.get(suffix, OTHER_MEDIA_TYPE)
    if storage.size(file.key) != file.bytes:
        raise ProblemError("not-found", f"{file.name} has been deleted")
    if request.method == "HEAD":
        return Response(status_code=status, headers=headers, media_type=media_type)
    return StreamingResponse(storage.stream(file.key, start, end), status, headers, media_type)


def _matches(header: str | None, tag: str) -> bool:
    tags = [each.strip().removeprefix("W/") for each in (header or "").split(",")]
    return tag in tags or "*" in tags


def _range(header: str | None, size: int) -> tuple[int, int] | None:
    """The one range asked for, as start and exclusive end; None: none, or nothing we understand.

    Reference:
        RFC 9110, section 14.2: a Range that is not understood is ignored.
    """
    found = re.fullmatch(r"bytes=(\d{0,18})-(\d{0,18})", (header or "").replace(" ", ""))
    if found is None or not (found[1] or found[2]):
        return None
    if found[1]:
        start, end = int(found[1]), min(int(found[2]) + 1 if found[2] else size, size)
        if found[2] and int(found[2]) < int(found[1]):
            return None
    else:
        start, end = max(0, size - int(found[2])), size
    if start >= size or start >= end:
        raise ProblemError(
            "range-not-satisfiable",
            f"the file has {size} bytes",
            headers={"Content-Range": f"bytes */{size}"},
        )
    return start, end
