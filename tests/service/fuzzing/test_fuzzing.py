"""Schemathesis asks a running front everything its OpenAPI document allows, and much that it does not."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest

from worker.queues import ALL_QUEUES, WorkerState
from worker.records import Fenced

HERE = Path(__file__).parent
EXAMPLES = os.environ.get("MATPHYS_FUZZ_EXAMPLES", "8")
"""Per operation and phase; by hand, more."""


@pytest.fixture
def busy(patient, tmp_path, monkeypatch) -> Iterator:
    """A front whose jobs end, as if workers did them."""
    monkeypatch.setattr(
        "worker.queues.Queues.workers",
        lambda self: [WorkerState("one", "idle", datetime.now(UTC), ALL_QUEUES)],
    )
    stopped = threading.Event()

    def work() -> None:
        while not stopped.wait(0.05):
            for job_id in [job for queue in ("twins", "exports") for job in patient.records.due(queue)]:
                try:
                    patient.finish(job_id, {"bundle.twin.zip": b"bundle"}, tmp_path)
                except (AssertionError, Fenced):
                    continue  # it was canceled or deleted meanwhile

    worker = threading.Thread(target=work)
    worker.start()
    yield patient
    stopped.set()
    worker.join()


@pytest.mark.slow
def test_schemathesis_finds_nothing(busy, clip, observation, tmp_path):
    (tmp_path / "clip.mp4").write_bytes(clip)
    (tmp_path / "seen.npz").write_bytes(observation)
    key = busy.keys.create("fuzzing", "default", ("submit", "read"))[1]
    done = subprocess.run(
        [
            *(
                str(Path(sys.executable).with_name("schemathesis")),
                "--config-file",
                str(HERE / "schemathesis.toml"),
            ),
            *("run", f"{busy.url}/openapi.json", "--header", f"Authorization: Bearer {key}"),
            *("--phases", "examples,coverage,fuzzing,stateful", "--max-examples", EXAMPLES),
            *("--request-timeout", "20", "--seed", "0", "--no-color"),
        ],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ
        | {
            "SCHEMATHESIS_HOOKS": "hooks",
            "PYTHONPATH": str(HERE),
            "MATPHYS_TEST_CLIP": str(tmp_path / "clip.mp4"),
            "MATPHYS_TEST_OBSERVATION": str(tmp_path / "seen.npz"),
        },
        check=False,
    )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    answered = httpx.get(f"{busy.url}/metrics").text
    for method, route, status in (
        ("POST", "/twins", 202),
        ("GET", "/twins/{id}", 200),
        ("DELETE", "/twins/{id}", 204),
    ):
        assert (
            f'matphys_http_request_seconds_count{{method="{method}",route="{route}",status="{status}"}}'
            in answered
        )
    assert 'method="POST",route="/twins/{id}/diagnoses",status="4' in answered  # none guesses a twin's id
    assert 'status="500"' not in answered
    assert busy.staged() == []
