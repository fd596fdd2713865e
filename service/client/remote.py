"""Jobs of the service as a program holds them."""

import json
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx

from model.gap.schema import GapReport
from model.job_schema import FINAL_STATUSES, DiagnosisRequest, Job, JobRequest
from model.schema import read_json
from service.client.transfers import all_jobs, fetch, read_job, start_job
from service.client.transport import ServiceError, Transport

POLL_S = 1.0
"""Between two looks at a job when nobody says how long [s]."""
LONGEST_POLL_S = 10.0
REPORT = "report.json"

Reporter = Callable[[Job], None]


class RemoteJob:
    """A job of the service. `job` is what it last said."""

    def __init__(self, transport: Transport, job: Job) -> None:
        """As `Client` makes it."""
        self._transport = transport
        self.job = job

    @property
    def id(self) -> str:
        """Of the job."""
        return self.job.id

    def refresh(self) -> Job:
        """Ask how it stands."""
        self.job = read_job(self._transport.request("GET", self._url()))
        return self.job

    def follow(self, timeout_s: float | None = None) -> Iterator[Job]:
        """The job whenever it has changed, the last time when it has ended.

        Events tell it at once; where they break off they are resumed, and where none come (a proxy that holds
        them back) the job is asked for.

        Raises:
            ServiceError: the service refused it or was not reached.
            TimeoutError: it has not ended in time; it goes on.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        yield self.refresh()
        last_id, pause = "", POLL_S
        while self.job.status not in FINAL_STATUSES:
            try:
                for event in self._transport.events(self._url("events"), last_id):
                    _check(deadline, self)
                    if event is None:
                        continue
                    last_id, pause = event.id or last_id, POLL_S
                    news = _news(event.data)
                    if news.get("status") in FINAL_STATUSES:
                        break
                    if any(getattr(self.job, name) != value for name, value in news.items()):
                        self.job = self.job.model_copy(update=news)
                        yield self.job
            except httpx.TransportError:
                pass
            except ServiceError as error:
                pause = pause if error.retry_after is None else error.retry_after
            before = self.job
            if self.refresh() != before:
                yield self.job
            if self.job.status not in FINAL_STATUSES:
                _check(deadline, self)
                time.sleep(pause)
                pause = min(2 * pause, 10.0)

    def wait(self, report: Reporter | None = None, timeout_s: float | None = None) -> Job:
        """Wait for the end.

        Args:
            report: Called with the job whenever it has changed.
            timeout_s: How long to wait [s]; None: as long as it takes.

        Raises:
            ServiceError: the job failed or was canceled (with its `type`, `title`, `detail`), or the service
                was not reached.
            TimeoutError: it has not ended in time; it goes on.
        """
        for job in self.follow(timeout_s):
            if report is not None:
                report(job)
        error = self.job.error
        if error is not None:
            raise ServiceError(error.title, error.detail, type=error.type, job_id=self.id)
        if self.job.status != "succeeded":
            raise ServiceError(f"The job was {self.job.status}", job_id=self.id)
        return self.job

    def logs(self) -> str:
        """The log so far."""
        return self._transport.request("GET", self._url("logs")).text

    def cancel(self) -> Job:
        """Cancel it; it must not have ended otherwise.

        Raises:
            ServiceError: it has ended already.
        """
        self.job = read_job(self._transport.request("POST", self._url("cancel"), repeatable=True))
        return self.job

    def delete(self) -> None:
        """Delete it with its files; what is gone already is deleted."""
        try:
            self._transport.request("DELETE", self._url())
        except ServiceError as error:
            if error.status != 404:
                raise

    def download(self, name: str, path: Path) -> Path:
        """Download a file; `path` then holds all of it, checked, or what it held before.

        Raises:
            ServiceError: there is no such file, what came is not what the job made, or the service was not
                reached.
        """
        file = next((file for file in self.job.files if file.name == name), None)
        if file is None:
            known = ", ".join(file.name for file in self.job.files) or "none yet"
            raise ServiceError("There is no such file", f"{name}: the job has {known}", job_id=self.id)
        fetch(self._transport, file.url, path, sha256=file.sha256)
        return path

    def _url(self, what: str = "self") -> str:
        return self.job.urls[what]


class Twin(RemoteJob):
    """A twin that is being made, or was."""

    def export(self, to: str, path: Path, timeout_s: float = 600.0) -> Path:
        """Have the twin exported, and download that.

        Args:
            to: A format: `ply`, ...
            path: Where to.
            timeout_s: How long to wait for it [s].

        Raises:
            ServiceError: the format is not known, the export failed, or the service was not reached.
            TimeoutError: it took too long.
        """
        url, deadline = f"{self._url()}/exports/{quote(to, safe='')}", time.monotonic() + timeout_s
        while (wait := fetch(self._transport, url, path)) is not None:
            _check(deadline, self)
            time.sleep(wait)
        return path

    def diagnose(
        self,
        seen: Path,
        *,
        transfer: Path | None = None,
        request: DiagnosisRequest | None = None,
        idempotency_key: str | None = None,
    ) -> "Diagnosis":
        """Ask where the twin departs from what really moved, which effect it lacks, how far the gap shrinks.

        Args:
            seen: An observation (`.npz`), or the twin's own clip.
            transfer: The observation of a second interaction, to confirm.
            request: What is chosen; None: nothing.
            idempotency_key: As for `Client.submit`.

        Raises:
            ServiceError: the service refused it or was not reached.
            OSError: a file cannot be read.
        """
        files = {"observation" if seen.suffix.lower() == ".npz" else "video": seen}
        files |= {} if transfer is None else {"transfer": transfer}
        started = self.start("diagnoses", files, request, idempotency_key=idempotency_key)
        return Diagnosis(self._transport, started.job)

    def diagnoses(self) -> "Iterator[Diagnosis]":
        """Those of this twin, newest first."""
        for job in all_jobs(self._transport, f"{self._url()}/diagnoses"):
            yield Diagnosis(self._transport, job)

    def start(
        self,
        collection: str,
        files: Mapping[str, Path],
        request: JobRequest | None = None,
        *,
        idempotency_key: str | None = None,
    ) -> RemoteJob:
        """Start a further job on this twin.

        Args:
            collection: Of its kind: `diagnoses`.
            files: Its inputs by name.
            request: What is chosen; None: nothing.
            idempotency_key: As for `Client.submit`.
        """
        url = f"{self._url()}/{collection}"
        return RemoteJob(self._transport, start_job(self._transport, url, files, request, idempotency_key))

    def started(self, collection: str) -> Iterator[RemoteJob]:
        """The jobs of a kind that were started on this twin, newest first."""
        for job in all_jobs(self._transport, f"{self._url()}/{collection}"):
            yield RemoteJob(self._transport, job)


class Diagnosis(RemoteJob):
    """A diagnosis that is being made, or was."""

    def report(self) -> GapReport:
        """The gap report, once it has succeeded.

        Raises:
            ServiceError: there is none (yet), or the service was not reached.
        """
        with tempfile.TemporaryDirectory() as folder:
            return read_json(
                self.download(REPORT, Path(folder) / REPORT).read_bytes(), GapReport, f"{self.id}: {REPORT}"
            )


def _news(data: str) -> Mapping[str, Any]:
    """What an event says of a job; nothing, where it is none that we know."""
    try:
        content = json.loads(data)
    except ValueError:
        return {}
    known = ("status", "stage", "progress")
    return {name: content[name] for name in known if name in content} if isinstance(content, dict) else {}


def _check(deadline: float | None, job: RemoteJob) -> None:
    if deadline is not None and time.monotonic() > deadline:
        raise TimeoutError(f"{job.id} is {job.job.status} still, at {job.job.progress:.0f} %")
