import json
from collections.abc import Callable, Iterator
from typing import get_args

import httpx
import pytest

from model.gap.schema import SOURCE_NAMES
from model.schema import EffectName
from service.client import Client

JOB = {
    "id": "a1",
    "kind": "twin",
    "status": "queued",
    "created_at": "2026-11-21T12:00:00Z",
    "urls": {
        "self": "/twins/a1",
        "events": "/twins/a1/events",
        "logs": "/twins/a1/logs",
        "cancel": "/twins/a1/cancel",
    },
}


class Broken(httpx.SyncByteStream):
    """A body that breaks off."""

    def __init__(self, *pieces: bytes) -> None:
        self.pieces = pieces

    def __iter__(self) -> Iterator[bytes]:
        yield from self.pieces
        raise httpx.ReadError("connection reset")


class Service:
    """Answers in the order it was told to, and remembers what it was asked."""

    def __init__(self) -> None:
        self.answers: list[Callable[[httpx.Request], httpx.Response]] = []
        self.asked: list[httpx.Request] = []

    def then(self, status: int = 200, **content) -> "Service":
        self.answers.append(lambda request: httpx.Response(status, **content))
        return self

    def breaks(self) -> "Service":
        def fail(request):
            raise httpx.ConnectError("refused")

        self.answers.append(fail)
        return self

    def job(self, **news) -> "Service":
        return self.then(json=JOB | news)

    def events(self, *texts: str, broken: bool = False) -> "Service":
        pieces = tuple(text.encode() for text in texts)
        return self.then(stream=Broken(*pieces)) if broken else self.then(content=b"".join(pieces))

    def __call__(self, request: httpx.Request) -> httpx.Response:
        request.read()
        self.asked.append(request)
        assert self.answers, f"nobody expected {request.method} {request.url}"
        return self.answers.pop(0)(request)


@pytest.fixture
def service():
    service = Service()
    yield service
    assert not service.answers, "not all was asked for"


@pytest.fixture
def client(service, monkeypatch):
    slept = []
    monkeypatch.setattr("service.client.transport.time.sleep", slept.append)
    with Client("http://test", "secret", http=httpx.MockTransport(service)) as client:
        client.slept = slept
        yield client


@pytest.fixture
def clip_path(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"frames" * 1000)
    return path


@pytest.fixture
def gap_report() -> bytes:
    """The smallest report: nothing is missing."""
    names = get_args(EffectName)
    content = {
        "schema": "matphys.gap/1",
        "verdict": {"effect": "none", "probability": 0.98, "statement": "Nothing is missing."},
        "gap": {"baseline": 0.002, "refit": 0.001, "noise_floor": 0.001, "heldout": [[0, 1]]},
        "effects": [{"name": name, "probability": 0.001} for name in names],
        "where": {"points": [1.0], "frames": [1.0], "acts_on": [0.0]},
        "sources": dict(zip(SOURCE_NAMES, (0.0, 0.0, 1.0, 0.0, 0.0), strict=True)),
    }
    return json.dumps(content).encode()
