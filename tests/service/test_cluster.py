"""Two fronts and three workers, real processes, on one Redis and an S3 server."""

import hashlib
import importlib.util
import json
import os
import sys
import time
from pathlib import Path

import httpx
import pytest

from model.job_schema import FINAL_STATUSES

ROOT = Path(__file__).parents[2]
JOBS = 24


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def cluster_module():
    return load(ROOT / "benchmarks/load/cluster.py")


@pytest.fixture(scope="module")
def worker_alive():
    """The health check of the workers' containers."""
    return load(ROOT / "deploy/worker_alive.py").alive


def camera(number):
    """No two naps are alike, or one would stand for both."""
    return {"note": ("n.json", json.dumps({"intrinsics": [[number, 0, 0], [0, number, 0], [0, 0, 1]]}))}


def wait_for_all(http, ids):
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        jobs = [http.get(f"/naps/{job_id}").json() for job_id in ids]
        if all(job["status"] in FINAL_STATUSES for job in jobs):
            return jobs
        time.sleep(0.1)
    raise TimeoutError([job["status"] for job in jobs])


@pytest.mark.slow
def test_fronts_and_workers_share_the_work(cluster_module, worker_alive, tmp_path):
    with cluster_module.cluster(tmp_path, fronts=2, workers=3, naps=True) as running:
        headers = {"Authorization": f"Bearer {running.key}"}
        one, other = (httpx.Client(base_url=f.url, headers=headers, timeout=30) for f in running.fronts)
        with one, other:
            ids = []
            for number in range(1, JOBS + 1):
                answer = (one, other)[number % 2].post(
                    "/naps",
                    files=camera(number),
                    data={"seconds": "0.3"},
                    headers={"Idempotency-Key": str(number)},
                )
                assert answer.status_code == 202, answer.text
                ids.append(answer.json()["id"])
            again = other.post(
                "/naps", files=camera(2), data={"seconds": "0.3"}, headers={"Idempotency-Key": "2"}
            )
            assert again.json()["id"] == ids[1]
            jobs = wait_for_all(one, ids)
            assert {job["status"] for job in jobs} == {"succeeded"}
            for job in jobs:
                (file,) = job["files"]
                for front in (one, other):
                    content = front.get(file["url"]).content
                    assert hashlib.sha256(content).hexdigest() == file["sha256"]
            assert sum(running.jobs_per_worker()) == JOBS
            assert min(running.jobs_per_worker()) >= 2
            last = other.get(f"/naps/{ids[0]}/events").text.strip().split("\n\n")[-1]
            assert '"succeeded"' in last
            assert one.get("/readyz").json()["checks"]["store"] == "ok"
            assert worker_alive(running.redis_url, os.uname().nodename.partition(".")[0])
            assert not worker_alive(running.redis_url, "elsewhere")
            assert not any(front.maps_torch for front in running.fronts)
    for process in (*running.fronts, *running.workers):
        assert process.popen.returncode in (0, -15), process.log.read_text()[-500:]


def test_a_worker_whose_redis_is_away_is_not_alive(worker_alive):
    assert not worker_alive("redis://127.0.0.1:1/0", "here")
