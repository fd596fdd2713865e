"""Around every request: a number, security headers, a line in the log, and the metrics."""

import logging
import time
from typing import Final
from uuid import uuid4

from starlette.datastructures import MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import answer, translate
from service.metrics import Metrics

log = logging.getLogger("matphys.access")

HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Cache-Control": "no-store",
}
"""Sent unless the response has its own. No CORS header is sent at all: other sites' pages read nothing."""
GONE: Final = 499
"""The status, in log and metrics alone, of a request whose client hung up."""
QUIET: Final = ("/livez", "/readyz", "/metrics")
"""Asked every few seconds: not in the log while all is well."""


class RequestFrame:
    """What happens around every request, whatever answers it."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        """Wrap the app."""
        self._app, self._metrics = app, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started, request_id = time.perf_counter(), str(uuid4())
        scope.setdefault("state", {})["request_id"] = request_id
        status = 0

        async def send_framed(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                headers["X-Request-ID"] = request_id
            await send(message)

        try:
            await self._app(scope, receive, send_framed)
        except ClientDisconnect:
            status = status or GONE
        except Exception as error:
            if status:  # too late for another answer: the connection is cut, and the client sees that
                raise
            log.exception("request failed", extra={"request_id": request_id})
            await answer(translate(error), request_id)(scope, receive, send_framed)
        finally:
            self._record(scope, status, time.perf_counter() - started)

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        route = getattr(scope.get("route"), "path", "unknown")
        self._metrics.request(route, scope["method"], status, seconds)
        if scope["path"] in QUIET and status < 400:
            return
        state = scope["state"]
        details = {
            "request_id": state["request_id"],
            "method": scope["method"],
            "route": route,
            "status": status,
        }
        details |= {name: state[name] for name in ("key", "tenant", "job", "kind") if name in state}
        log.info("request", extra=details | {"seconds": round(seconds, 4)})
