"""A front over a real Redis and a real store, asked over real HTTP; no worker: tests do what one would."""

import io
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import httpx
import numpy as np
import pytest
import uvicorn

from service.app import ALL_CHILDREN, create_app
from service.auth import SCOPES, ApiKeys
from service.connections import PromptProtocol
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


def front_settings(redis_url: str, data: Path, **changes) -> Settings:
    chosen = Settings(
        redis_url=redis_url,
        store_url=f"file://{data / 'store'}",
        data_dir=data,
        max_upload_mib=4,
        min_free_mib=1,
        idle_seconds=2.0,
    )
    return replace(chosen, **changes)


@contextmanager
def running_front(settings: Settings, children=ALL_CHILDREN) -> Iterator[Serving]:
    with connect(settings.redis_url) as client, socket.create_server(("127.0.0.1", 0)) as listener:
        app = create_app(settings, children)
        config = uvicorn.Config(
            app, http=PromptProtocol, log_config=None, access_log=False, timeout_graceful_shutdown=3
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        yield Serving(url, settings, ApiKeys(client), Records(client), Storage(settings.store_url))
        server.should_exit = True
        thread.join(10)
        assert not thread.is_alive()


@pytest.fixture
def redis_url(redis_server) -> str:
    with connect(redis_server.url) as client:
        client.flushall()
    return redis_server.url


@pytest.fixture
def settings(redis_url, tmp_path) -> Settings:
    return front_settings(redis_url, tmp_path / "data")


@pytest.fixture
def serve(settings) -> Iterator:
    """Starts a front: `serve(max_jobs=1)`, `serve(children=(…,))`."""
    with ExitStack() as stack:
        yield lambda children=ALL_CHILDREN, **changes: stack.enter_context(
            running_front(replace(settings, **changes), children)
        )


@pytest.fixture(scope="module")
def patient(redis_server, tmp_path_factory) -> Iterator[Serving]:
    """One front for all tests of a module, which asks for no restraint."""
    with connect(redis_server.url) as client:
        client.flushall()
    data = tmp_path_factory.mktemp("patient")
    limits = {
        name: 10**6 for name in ("submissions_per_minute", "requests_per_minute", "refusals_per_minute")
    }
    with running_front(front_settings(redis_server.url, data, **limits)) as serving:
        yield serving


@pytest.fixture
def serving(serve) -> Serving:
    return serve()


@pytest.fixture
def http(serving) -> Iterator[httpx.Client]:
    with serving.client() as client:
        yield client


@pytest.fixture(scope="session")
def clip(film) -> bytes:
    """A tiny MP4 of something that moves."""
    return film()


@pytest.fixture(scope="session")
def observation() -> bytes:
    """A tiny observation of something that is carried along."""
    times = np.arange(12) / 30
    carried = np.stack([0.1 * times, 0 * times, 1 + 0 * times], -1)[:, None].astype(np.float32)
    corners = 0.1 * np.stack(np.meshgrid(*3 * [[0.0, 1.0]]), -1).reshape(-1, 3).astype(np.float32)
    target = io.BytesIO()
    np.savez(target, times=times, points=carried + corners, controllers=carried)
    return target.getvalue()
