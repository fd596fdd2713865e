"""The way in: a service and a key."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import quote

import httpx

from model.job_schema import JobStatus, TwinRequest
from model.version import __version__
from service.client.remote import Twin
from service.client.transfers import all_jobs, read_job, start_job
from service.client.transport import Transport

SILENCE_S = 60.0
"""How long a connection may say nothing [s]; events bring a sign of life more often."""


class Client:
    """The service at one address, with one key.

    Args:
        url: `http://host:port`.
        key: As `matphys-serve` printed it.
        patience_s: How long a request that may safely be repeated is tried again while the service is away,
            busy or restarting [s].
        http: A transport to use instead of the network.
    """

    def __init__(
        self,
        url: str,
        key: str,
        *,
        patience_s: float = 60.0,
        http: httpx.BaseTransport | None = None,
    ) -> None:
        """Nothing is sent yet."""
        headers = {"Authorization": f"Bearer {key}", "User-Agent": f"matphys/{__version__}"}
        timeout = httpx.Timeout(SILENCE_S, connect=10.0)
        self._http = httpx.Client(base_url=url, headers=headers, timeout=timeout, transport=http)
        self._transport = Transport(self._http, patience_s)

    def __enter__(self) -> Self:
        """Close at the end of the block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the connections."""
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def submit(
        self,
        video: Path,
        request: TwinRequest | None = None,
        *,
        files: Mapping[str, Path] | None = None,
        idempotency_key: str | None = None,
    ) -> Twin:
        """Upload a clip and ask for its twin.

        Args:
            video: The clip.
            request: What is chosen; None: nothing.
            files: Further inputs by name: `mask`, `camera`, `mesh`, `depth`, `controllers`.
            idempotency_key: The same key with the same content gives the same twin, also from another
                process; None: one of this call, which may then be tried again without making two.

        Raises:
            ServiceError: the service refused it or was not reached.
            OSError: a file cannot be read.
        """
        job = start_job(
            self._transport, "/twins", {"video": video, **(files or {})}, request, idempotency_key
        )
        return Twin(self._transport, job)

    def twin(self, twin_id: str) -> Twin:
        """A twin by its id.

        Raises:
            ServiceError: there is none.
        """
        return Twin(
            self._transport, read_job(self._transport.request("GET", f"/twins/{quote(twin_id, safe='')}"))
        )

    def twins(self, status: JobStatus | None = None) -> Iterator[Twin]:
        """All twins of this key's owner, newest first, fetched as they are needed."""
        for job in all_jobs(self._transport, "/twins", status):
            yield Twin(self._transport, job)
