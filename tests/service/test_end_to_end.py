"""`matphys-serve` as it is, with its own Redis and worker, and the client: the demo's clip becomes a twin."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
import zipfile

import httpx
import mujoco
import numpy as np
import pytest
import torch
import trimesh
from pxr import Usd

from model.bundle import TwinBundle
from service.client import Client, TwinRequest
from worker.kinds.export import FORMATS

ONE_THREAD = {**os.environ, "OMP_NUM_THREADS": "1"}


def start(folder, port):
    """The service; it prints its address once it answers, and on its first start a key."""
    command = [sys.executable, "-m", "service.main", "--port", str(port), "--data-dir", str(folder / "data")]
    environment = {
        name: value for name, value in ONE_THREAD.items() if name not in ("REDIS_URL", "STORE_URL")
    }
    with (folder / "log").open("ab") as log:
        return subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)


def first_key(folder):
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if found := re.search(r"^API key: (\S+)$", (folder / "log").read_text(), re.M):
            return found[1]
        time.sleep(0.05)
    raise TimeoutError((folder / "log").read_text())


@pytest.fixture
def port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


def check_every_format(twin, bundle, folder):
    """Each as another program reads it."""
    fetched = {}
    for name, file in FORMATS.items():
        fetched[name] = twin.export(name, folder / file)
        if zipfile.is_zipfile(fetched[name]):
            zipfile.ZipFile(fetched[name]).extractall(folder / f"{name}-files")
    assert len(trimesh.load(fetched["ply"]).vertices) == len(bundle.gaussians)
    shown = trimesh.load(fetched["glb"])
    assert len(shown.geometry) == 1
    stage = Usd.Stage.Open(str(fetched["usd"]))
    assert stage.GetPrimAtPath("/Twin/Gaussians").IsValid()
    springs = len(bundle.topology.springs) + len(bundle.topology.controller_springs)
    assert mujoco.MjModel.from_xml_path(str(folder / "mujoco-files" / "twin.xml")).ntendon == springs
    (checkpoint,) = (folder / "phystwin-files").rglob("best_0.pth")
    strength = torch.load(checkpoint, weights_only=True)["spring_Y"]
    assert int((strength > 0).sum()) == springs, "the others, which its rule makes, do nothing"
    with np.load(folder / "newton-files" / "twin.npz") as arrays:
        assert len(arrays["edges"]) == springs


@pytest.mark.slow
def test_a_clip_becomes_a_twin_though_the_front_is_killed_meanwhile(tmp_path, port):
    clip = tmp_path / "demo.mp4"
    subprocess.run([sys.executable, "-m", "model.scenes.demo", str(clip)], check=True, env=ONE_THREAD)
    running = [start(tmp_path, port)]
    stages, killed = [], []

    def report(job):
        if job.stage and job.stage not in stages:
            stages.append(job.stage)
        if job.stage == "segmentation" and not killed:
            killed.append(job.stage)
            running[-1].kill()
            running[-1].wait()
            running.append(start(tmp_path, port))

    try:
        with Client(f"http://127.0.0.1:{port}", first_key(tmp_path), patience_s=60) as client:
            twin = client.submit(clip, TwinRequest(points=300, parts=2))
            job = twin.wait(report, timeout_s=300)
            assert killed
            assert {"segmentation", "tracking", "simulation", "preview"} <= set(stages)
            bundle = TwinBundle.load(twin.download("bundle.twin.zip", tmp_path / "demo.twin.zip"))
            assert len(bundle.parts) <= 2
            assert bundle.preview == twin.download("preview.mp4", tmp_path / "p.mp4").read_bytes()
            check_every_format(twin, bundle, tmp_path)
            assert "tracking begins" in twin.logs()
            assert job.metrics["silhouette_iou"] > 0.5
        text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
        assert re.search(r'matphys_\w+\{[^}]*kind="twin"[^}]*\} 1', text)
    finally:
        running[-1].send_signal(signal.SIGTERM)
        assert running[-1].wait(60) == 0
