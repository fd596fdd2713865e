"""The body of a request becomes files of ours: streamed, counted, hashed, and on the disk."""

import asyncio
import contextlib
import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, field
from email.message import Message
from io import FileIO
from pathlib import Path
from uuid import uuid4

from fastapi.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request

from service.errors import ProblemError
from service.multipart import FormReader
from service.settings import MEBIBYTE

BYTES = "application/octet-stream"
RAW_TYPES = (BYTES, "binary/octet-stream")
"""Media types of a body that is the file itself, whatever it is."""
VIDEO_TYPES = ("application/mp4", "application/x-matroska")
"""Those of one that is a video, besides `video/*`."""
FORM_OVERHEAD = MEBIBYTE
"""Bytes of a form that are not its files."""
LINGER_BYTES = 16 * MEBIBYTE
LINGER_SECONDS = 2.0
"""How much of a body that is refused is still listened to."""


DRIP_SECONDS, DRIP_BYTES = 60.0, 1024
"""A body that has come for so long [s] comes at no fewer bytes a second: each holds descriptors meanwhile."""
CHECKED_BYTES = 8 * MEBIBYTE
"""After so many the room on the disk is looked at again."""


@dataclass(frozen=True)
class StagedFile:
    """One file of an upload, on the disk."""

    path: Path
    bytes: int
    sha256: str


@dataclass(frozen=True)
class Upload:
    """What a request brought."""

    files: Mapping[str, StagedFile]
    fields: Mapping[str, str] = field(default_factory=dict)
    """Text fields of a form."""


@dataclass(frozen=True)
class Intake:
    """How uploads are taken in.

    Args:
        staging: A folder for them, on the file system of the data.
        max_bytes: Of one request.
        min_free_bytes: What must stay free on the disk.
        idle_seconds: How long a client may send nothing.
    """

    staging: Path
    max_bytes: int
    min_free_bytes: int
    idle_seconds: float

    @asynccontextmanager
    async def receive(self, request: Request, limits: Mapping[str, int]) -> AsyncIterator[Upload]:
        """Read the body into a folder that is gone when the block ends.

        Args:
            request: Authenticated already: nothing of its body was read yet.
            limits: Name of each input → its largest size [bytes]. A raw body is the first of them, and a
                raw body of a type `video/*` is the one called `video`.

        Raises:
            ProblemError: too large, of another media type, stalled, cut off, or no room on the disk.
        """
        main, boundary = _content_type(request, tuple(limits))
        self._check_room(_declared_length(request, self.max_bytes))
        folder = self.staging / uuid4().hex
        lock = await run_in_threadpool(self._claim, folder)
        sink = _Sink(folder, limits)
        try:
            if main is None:
                yield await self._form(request, boundary, sink, limits)
            else:
                yield await self._raw(request, main, sink)
        finally:
            sink.abandon()
            await run_in_threadpool(shutil.rmtree, folder, True)
            os.close(lock)

    def sweep(self) -> None:
        """Remove what killed fronts left behind: folders that no living process holds."""
        with self._gate():
            for folder in self.staging.iterdir():
                if folder.is_dir() and (lock := _locked(folder)) is not None:
                    shutil.rmtree(folder, ignore_errors=True)
                    os.close(lock)

    def _claim(self, folder: Path) -> int:
        """Make a folder that is ours for as long as we live or until the descriptor given is closed."""
        with self._gate():
            folder.mkdir(mode=0o700)
            lock = _locked(folder)
        assert lock is not None
        return lock

    @contextmanager
    def _gate(self) -> Iterator[None]:
        """One at a time, of all fronts here: nobody sweeps a folder before it is locked."""
        self.staging.mkdir(mode=0o700, parents=True, exist_ok=True)
        with self.staging.with_suffix(".lock").open("a") as gate:
            fcntl.flock(gate, fcntl.LOCK_EX)
            yield

    def free_bytes(self) -> int:
        """What is free on the disk beyond what must stay free; negative: less than that."""
        return shutil.disk_usage(self.staging).free - self.min_free_bytes

    def _check_room(self, wanted: int) -> None:
        if self.free_bytes() < wanted:
            raise ProblemError("no-space", "try again later", retry_after=60)

    async def _raw(self, request: Request, main: str, sink: "_Sink") -> Upload:
        sink.write(main, b"")
        async for chunk in self._chunks(request):
            sink.write(main, chunk)
        return Upload(await run_in_threadpool(sink.finish))

    async def _form(
        self, request: Request, boundary: str, sink: "_Sink", limits: Mapping[str, int]
    ) -> Upload:
        reader = FormReader(boundary, tuple(limits), sink.write)
        async for chunk in self._chunks(request):
            reader.feed(chunk)
        reader.close()
        return Upload(await run_in_threadpool(sink.finish), reader.fields)

    async def _chunks(self, request: Request) -> AsyncIterator[bytes]:
        """The body, as long as it keeps coming and is not too long."""
        total, checked, stream = 0, 0, request.stream().__aiter__()
        began = time.monotonic()
        while True:
            try:
                async with asyncio.timeout(self.idle_seconds):
                    chunk = await anext(stream, None)
            except TimeoutError:
                raise _stalled(f"nothing came for {self.idle_seconds:g} s") from None
            if chunk is None:
                return
            total += len(chunk)
            if total > self.max_bytes + FORM_OVERHEAD:
                raise _too_large("the request", self.max_bytes)
            spent = time.monotonic() - began
            if spent > DRIP_SECONDS and total < DRIP_BYTES * spent:
                raise _stalled(
                    f"{total} bytes came in {spent:.0f} s: at least {DRIP_BYTES} a second are waited for"
                )
            if total - checked >= CHECKED_BYTES:  # who does not say how much comes may bring more than fits
                await run_in_threadpool(self._check_room, 0)
                checked = total
            yield chunk


class _Sink:
    """The files of one upload while they grow."""

    def __init__(self, folder: Path, limits: Mapping[str, int]) -> None:
        self._folder, self._limits = folder, limits
        self._open: dict[str, FileIO] = {}
        self._sizes: dict[str, int] = {}
        self._hashes = {name: hashlib.sha256() for name in limits}

    def write(self, name: str, data: bytes) -> None:
        """Append to a file; the names are ours (keys of `limits`), never a client's."""
        if name not in self._open:
            self._open[name] = FileIO(self._folder / name, "xb")
            self._sizes[name] = 0
        self._sizes[name] += len(data)
        if self._sizes[name] > self._limits[name]:
            raise _too_large(name, self._limits[name])
        self._hashes[name].update(data)
        rest = memoryview(data)
        while rest:  # a disk that fills up takes a part, then raises
            rest = rest[self._open[name].write(rest) :]

    def finish(self) -> dict[str, StagedFile]:
        """Have everything on the disk."""
        staged = {}
        for name, file in self._open.items():
            os.fsync(file.fileno())
            if self._sizes[name] == 0:
                raise ProblemError("bad-input", f"{name}: the file is empty")
            staged[name] = StagedFile(self._folder / name, self._sizes[name], self._hashes[name].hexdigest())
        self.abandon()
        return staged

    def abandon(self) -> None:
        for file in self._open.values():
            file.close()


def _content_type(request: Request, names: Sequence[str]) -> tuple[str | None, str]:
    """Which input a raw body is; None: it is a form, with this boundary."""
    if request.headers.get("content-encoding", "identity").lower() != "identity":
        raise ProblemError("unsupported-media-type", "send the body as it is, without a Content-Encoding")
    content_type = request.headers.get("content-type", BYTES)
    message = Message()
    message["Content-Type"] = content_type
    media_type = content_type.partition(";")[0].strip().lower()
    if media_type == "multipart/form-data":
        boundary = message.get_param("boundary")
        if not isinstance(boundary, str) or not boundary:
            raise ProblemError("bad-request", "the Content-Type of a form needs a boundary")
        return None, boundary
    if (media_type.startswith("video/") or media_type in VIDEO_TYPES) and "video" in names:
        return "video", ""
    if media_type in RAW_TYPES:
        return names[0], ""
    raise ProblemError(
        "unsupported-media-type",
        f"send the {names[0]} as a body of type application/octet-stream, or a form (multipart/form-data)",
    )


async def listen_on(request: Request) -> None:
    """Let a client that is still sending finish, for a moment: one that is cut off does not hear why.

    For requests whose key is known to be good, and whose client does not wait for a word before it sends.
    """
    if "expect" in request.headers:
        return
    heard = 0
    with contextlib.suppress(
        TimeoutError, ClientDisconnect, RuntimeError
    ):  # the last: it was read to the end
        async with asyncio.timeout(LINGER_SECONDS):
            async for chunk in request.stream():
                heard += len(chunk)
                if heard > LINGER_BYTES:
                    return


def _declared_length(request: Request, limit: int) -> int:
    """What the client says it will send; 0 where it does not say."""
    text = request.headers.get("content-length", "0")
    length = int(text) if text.isdecimal() and len(text) < 19 else limit + FORM_OVERHEAD + 1
    if length > limit + FORM_OVERHEAD:
        raise _too_large("the request", limit)
    return length


def _stalled(detail: str) -> ProblemError:
    return ProblemError("upload-stalled", detail, headers={"Connection": "close"})


def _too_large(what: str, limit: int) -> ProblemError:
    size = f"{limit / MEBIBYTE:g} MiB" if limit >= MEBIBYTE else f"{limit} bytes"
    # The rest of the body will not be read, so the connection is of no more use.
    return ProblemError("too-large", f"{what}: at most {size} are taken", headers={"Connection": "close"})


def _locked(folder: Path) -> int | None:
    """A descriptor that holds a folder until its process ends; None where a living process does."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    return descriptor
