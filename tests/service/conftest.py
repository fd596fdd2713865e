"""A front over a real Redis and a real store, asked over real HTTP; no worker: tests do what one would."""

import io
import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import av
import httpx
import numpy as np
import pytest
import uvicorn

from service.app import create_app
from service.auth import SCOPES, ApiKeys
from service.settings import Settings
from worker.embedded import EmbeddedRedis
from worker.queues import connect
from worker.record import JobRecord, files_prefix
from worker.records import Records
from worker.storage import Storage


@dataclass
class Serving:
    """A running front, and what stands behind it."""

    url: str
    settings: Settings
    keys: ApiKeys
    records: Records
    storage: Storage

    def client(self, tenant: str = "default", scopes=SCOPES, **headers: str) -> httpx.Client:
        key = self.keys.create("test", tenant, scopes)[1]
        return httpx.Client(
            base_url=self.url, headers={"Authorization": f"Bearer {key}"} | headers, timeout=30
        )

    def finish(self, job_id: str, files: dict[str, bytes], tmp_path: Path, metrics=None) -> JobRecord:
        """Do what a worker does at the end of a job."""
        attempt = self.records.begin(job_id, "token", "worker")
        assert attempt is not None
        self.records.advance(job_id, attempt, "simulation", 50.0)
        published = []
        for name, content in files.items():
            (tmp_path / name).write_bytes(content)
            key = f"{files_prefix(job_id)}{attempt}/{name}"
            published.append(self.storage.publish(key, tmp_path / name))
        self.records.succeed(job_id, attempt, published, metrics or {})
        record = self.records.get(job_id)
        assert record is not None
        return record

    def staged(self) -> list[Path]:
        return [path for path in self.settings.staging.rglob("*") if path.is_file()]

    def stored(self) -> list[str]:
        return list(self.storage.list())


@pytest.fixture(scope="session")
def redis_server(tmp_path_factory) -> Iterator[EmbeddedRedis]:
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        yield server


@pytest.fixture
def redis_url(redis_server) -> str:
    with connect(redis_server.url) as client:
        client.flushall()
    return redis_server.url


@pytest.fixture
def settings(redis_url, tmp_path) -> Settings:
    data = tmp_path / "data"
    return Settings(
        redis_url=redis_url,
        store_url=f"file://{data / 'store'}",
        data_dir=data,
        max_upload_mib=4,
        min_free_mib=1,
        idle_seconds=2.0,
    )


@pytest.fixture
def serve(settings) -> Iterator:
    """Starts a front: `serve(max_jobs=1)`, `serve(children=(…,))`."""
    started = []

    def start(children=(), **changes) -> Serving:
        chosen = replace(settings, **changes)
        listener = socket.create_server(("127.0.0.1", 0))
        config = uvicorn.Config(
            create_app(chosen, children), log_config=None, access_log=False, timeout_graceful_shutdown=3
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        client = connect(chosen.redis_url)
        started.append((server, thread, client, listener))
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        return Serving(url, chosen, ApiKeys(client), Records(client), Storage(chosen.store_url))

    yield start
    for server, thread, client, listener in started:
        server.should_exit = True
        thread.join(10)
        client.close()
        listener.close()
        assert not thread.is_alive()


@pytest.fixture
def serving(serve) -> Serving:
    return serve()


@pytest.fixture
def http(serving) -> Iterator[httpx.Client]:
    with serving.client() as client:
        yield client


@pytest.fixture(scope="session")
def clip() -> bytes:
    """A tiny MP4 of something that moves."""
    return make_clip()


def make_clip(
    frames: int = 6, size: tuple[int, int] = (64, 48), container: str = "mp4", rate: int = 30
) -> bytes:
    target = io.BytesIO()
    with av.open(target, "w", format=container) as out:
        stream = out.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for index in range(frames):
            image = np.zeros((size[1], size[0], 3), np.uint8)
            image[:, index : index + 8] = 255
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                out.mux(packet)
        for packet in stream.encode():
            out.mux(packet)
    return target.getvalue()
