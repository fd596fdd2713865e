"""Requests of the client: tried again when that is safe, refused in one kind of error."""

import random
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from typing import Any, TypeVar

import httpx
from pydantic import ValidationError

from model.job_schema import Problem

BRIEFLY = frozenset({408, 425, 429, 502, 503, 504})
"""Statuses after which the same request may succeed."""
SAFE = frozenset({"GET", "HEAD", "DELETE"})
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.2, 10.0

T = TypeVar("T")
Body = Callable[[ExitStack], Mapping[str, Any]]
"""Makes the body of one attempt as arguments for httpx; files it opens are closed by the stack."""


class ServiceError(Exception):
    """What the service refused, could not do, or why it was not reached.

    Attributes:
        status: Of the answer; None: there was none, or a job failed.
        type: What kind of problem, a URI (RFC 9457).
        title: In a few words.
        detail: One line: what was wrong, in which input, what to do.
        instance: The number under which the service has logged it.
        errors: Each field and what is wrong with it.
        retry_after: Seconds after which another try may succeed.
        job_id: Of the job that failed.
    """

    def __init__(
        self,
        title: str,
        detail: str | None = None,
        *,
        status: int | None = None,
        type: str = "about:blank",
        instance: str | None = None,
        errors: tuple[Mapping[str, str], ...] = (),
        retry_after: float | None = None,
        job_id: str | None = None,
    ) -> None:
        """See the class."""
        self.title, self.detail, self.status, self.type = title, detail, status, type
        self.instance, self.errors, self.retry_after, self.job_id = instance, errors, retry_after, job_id
        super().__init__(f"{title}: {detail}" if detail else title)


@dataclass(frozen=True)
class ServerEvent:
    """One server-sent event."""

    id: str
    name: str
    data: str


class Transport:
    """Sends requests.

    Args:
        http: Knows the address and the key.
        patience_s: How long a request that may be repeated is tried [s].
    """

    def __init__(self, http: httpx.Client, patience_s: float) -> None:
        """Send nothing yet."""
        self.http, self._patience_s = http, patience_s

    def request(
        self,
        method: str,
        url: str,
        *,
        headers: Mapping[str, str] | None = None,
        params: Mapping[str, str | int] | None = None,
        body: Body | None = None,
        repeatable: bool | None = None,
    ) -> httpx.Response:
        """One answer, read whole.

        Args:
            method: GET, POST, DELETE.
            url: Path below the service's address.
            headers: Further ones.
            params: Of the query.
            body: Called once an attempt.
            repeatable: Whether doing it twice is doing it once; None: as the method says.

        Raises:
            ServiceError: refused, or not reached in time.
        """

        def attempt() -> httpx.Response:
            with ExitStack() as stack:
                content = {} if body is None else body(stack)
                response = self.http.request(method, url, headers=headers, params=params, **content)
            if not response.is_success:
                raise as_error(response)
            return response

        again = method in SAFE if repeatable is None else repeatable
        return self.patiently(attempt, 0.0 if not again else None)

    def patiently(self, attempt: Callable[[], T], patience_s: float | None = None) -> T:
        """Try until it works.

        Raises:
            ServiceError: it never will, or did not in `patience_s` (None: this client's) seconds.
        """
        patience = self._patience_s if patience_s is None else patience_s
        deadline = time.monotonic() + patience
        for pause in _pauses():
            try:
                return attempt()
            except httpx.TransportError as failure:
                problem = unreachable(self.http, failure)
            except ServiceError as refusal:
                problem = refusal
            wait = pause if problem.retry_after is None else problem.retry_after
            hopeless = problem.status is not None and problem.status not in BRIEFLY
            if hopeless or time.monotonic() + wait > deadline:
                raise problem
            time.sleep(wait)
        raise AssertionError("pauses never end")

    @contextmanager
    def stream(self, url: str, headers: Mapping[str, str] | None = None) -> Iterator[httpx.Response]:
        """One answer to GET, read as it comes; not tried again.

        Raises:
            ServiceError: refused.
            httpx.TransportError: not reached, or broken off.
        """
        with self.http.stream("GET", url, headers=headers) as response:
            if not response.is_success:
                response.read()
                raise as_error(response)
            yield response

    def events(self, url: str, last_id: str = "") -> Iterator[ServerEvent | None]:
        """The events of a stream, from the one after `last_id` on; None for a sign of life.

        Raises:
            ServiceError: refused.
            httpx.TransportError: not reached, or broken off.
        """
        headers = {"Accept": "text/event-stream"} | ({"Last-Event-ID": last_id} if last_id else {})
        with self.stream(url, headers) as response:
            fields: dict[str, str] = {}
            for line in response.iter_lines():
                name, _, value = line.partition(":")
                value = value.removeprefix(" ")
                if line and name == "data":
                    fields[name] = f"{fields[name]}\n{value}" if name in fields else value
                elif line and name:
                    fields[name] = value
                elif line:
                    yield None
                elif "data" in fields:
                    yield ServerEvent(
                        fields.get("id", ""), fields.get("event", "message"), fields.pop("data")
                    )
                    fields = {}


def as_error(response: httpx.Response) -> ServiceError:
    """The problem an answer holds; an answer that is none (a proxy's page) is told by its status."""
    wait = retry_after(response)
    try:
        problem = Problem.model_validate_json(response.content)
    except ValidationError:
        title = f"{response.status_code} {response.reason_phrase}".strip()
        return ServiceError(title, status=response.status_code, retry_after=wait)
    return ServiceError(
        problem.title,
        problem.detail,
        status=response.status_code,
        type=problem.type,
        instance=problem.instance,
        errors=problem.errors or (),
        retry_after=wait,
    )


def retry_after(response: httpx.Response) -> float | None:
    """Seconds that the answer asks to wait; it may also name the moment (RFC 9110, section 10.2.3)."""
    text = response.headers.get("Retry-After", "").strip()
    if text.isdigit():
        return float(text)
    try:
        return max(0.0, parsedate_to_datetime(text).timestamp() - time.time())
    except ValueError:
        return None


def unreachable(http: httpx.Client, error: httpx.TransportError) -> ServiceError:
    """The error for an answer that did not come."""
    return ServiceError(f"{http.base_url} cannot be reached", str(error) or type(error).__name__)


def _pauses() -> Iterator[float]:
    """Ever longer, and never in step with other clients."""
    pause = FIRST_PAUSE_S
    while True:
        yield pause * random.uniform(0.5, 1.0)
        pause = min(2 * pause, LONGEST_PAUSE_S)
