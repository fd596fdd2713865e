"""A clip becomes a twin, and the twin an export, by `matphys-worker` as it is."""

import json
import os
import subprocess
import sys
from hashlib import sha256

import cv2
import numpy as np
import pytest

from model.bundle import TwinBundle
from model.formats.movie import encode_mp4
from worker.kinds.twin import BUNDLE, SHOWN
from worker.record import files_prefix


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A hand lifts a furry thing from a table: 12 frames of 192×144."""
    rng, height, width = np.random.default_rng(0), 144, 192
    fur = np.clip(
        (62, 88, 120) + 60 * cv2.GaussianBlur(rng.normal(size=(height, width, 1)), (0, 0), 1)[..., None],
        0,
        255,
    )
    thing, hand = np.zeros((2, height, width), np.uint8)
    cv2.ellipse(thing, (96, 96), (34, 26), 0, 0, 360, 255, -1)
    cv2.ellipse(hand, (96, 62), (12, 14), 0, 0, 360, 255, -1)
    cv2.line(hand, (96, 56), (120, -40), 255, 20)
    images = []
    for rise in 12 * (1 - np.cos(np.linspace(0, np.pi, 12))):
        move = np.float32([[1, 0, 0], [0, 1, -rise]])
        image = np.full((height, width, 3), (150, 158, 165), np.float32)
        for mask, color in (
            (thing, cv2.warpAffine(fur.astype(np.float32), move, (width, height))),
            (hand, (214, 160, 130)),
        ):
            where = cv2.warpAffine(mask, move, (width, height)) > 127
            image[where] = color[where] if isinstance(color, np.ndarray) else color
        noisy = cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, 2, image.shape)
        images.append(np.clip(noisy, 0, 255).astype(np.uint8))
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    path.write_bytes(encode_mp4(images, np.arange(12) / 30))
    return path


@pytest.fixture
def worker(redis_server, client, tmp_path):
    environment = os.environ | {
        "REDIS_URL": redis_server.url,
        "STORE_URL": f"file://{tmp_path}/store",
        "MATPHYS_SCRATCH": str(tmp_path / "scratch"),
    }
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen([sys.executable, "-m", "worker.main"], env=environment, stderr=log)
    yield process
    process.terminate()
    assert process.wait(40) == 0


@pytest.mark.slow
def test_a_clip_becomes_a_twin_and_the_twin_an_export(
    worker, clip, records, queues, progress, storage, errand, eventually, tmp_path
):
    def finish(record, seconds):
        queues.enqueue(records.create(record)[0])
        eventually(lambda: records.get(record.id).final or worker.poll() is not None, seconds)
        done = records.get(record.id)
        assert done.status == "succeeded", (done, (tmp_path / "log").read_text()[-3000:])
        return done

    asked = errand(kind="twin", options={"points": 150, "parts": 2, "box": None})
    key = f"{files_prefix(asked.id)}input/video.mp4"
    storage.publish(key, clip)
    twin = finish(asked.model_copy(update={"inputs": {"video": key}}), 240)
    assert {file.name for file in twin.files} == {BUNDLE, *SHOWN, "summary.json"}
    assert twin.metrics["points"] >= 100
    content = {file.name: b"".join(storage.stream(file.key)) for file in twin.files}
    for file in twin.files:
        assert (len(content[file.name]), sha256(content[file.name]).hexdigest()) == (file.bytes, file.sha256)
    (tmp_path / BUNDLE).write_bytes(content[BUNDLE])
    bundle = TwinBundle.load(tmp_path / BUNDLE)
    assert json.loads(content["summary.json"])["counts"]["points"] == len(bundle.topology.points)
    assert json.loads(content["twin.json"])["source"]["sha256"] == sha256(clip.read_bytes()).hexdigest()
    stages = list(dict.fromkeys(event.stage for event in progress.read(twin.id)))
    assert stages[:4] == ["", "starting", "video", "segmentation"]
    assert stages[-3:] == ["preview", "publishing", "done"]
    assert any("segmentation begins" in line for line in progress.read_log(twin.id))

    export = finish(errand(kind="export", queue="exports", parent=twin.id, options={"format": "ply"}), 60)
    (file,) = export.files
    assert file.name == "twin.ply"
    assert b"".join(storage.stream(file.key)).startswith(b"ply\n")
