"""A diagnosis by `matphys-worker` as it is, asked for over HTTP: nothing stands in for the model."""

import html
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.gap.schema import EFFECT_NAMES
from model.observation import write_observation
from model.schema import SCHEMA, BundleManifest
from model.types import Gaussians, Observation, Parameter, Parameters, Topology
from service.auth import SCOPES
from service.client import Client, ServiceError

POINTS, STEP, FRAMES = 6, 0.05, 16
STAGES = ("observation", "refit", "screen", "confirm", "weigh", "where", "report")


@pytest.fixture
def rope() -> TwinBundle:
    """A few points that hang below a hand."""
    index = np.arange(POINTS)
    points = np.stack([0.01 * np.sin(index), 0 * index, 1.0 - STEP * index], -1).astype(np.float32)
    springs = np.stack([index[:-1], index[1:]], -1).astype(np.int32)
    length = np.linalg.norm(points[1:] - points[:-1], axis=-1).astype(np.float32)
    ones = np.ones(POINTS, np.float32)
    values = {"dashpot_damping": "N*s/m", "drag_rate": "1/s", "friction": "1", "restitution": "1"}
    return TwinBundle(
        manifest=BundleManifest.model_validate({"schema": SCHEMA}),
        gaussians=Gaussians(
            means=points,
            scales=np.full((POINTS, 3), 0.01, np.float32),
            quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (POINTS, 1)),
            opacities=0.9 * ones,
            colors=np.full((POINTS, 3), 0.5, np.float32),
            volumes=1e-6 * ones,
        ),
        topology=Topology(
            points=points,
            mass=0.01 * ones,
            springs=springs,
            rest_length=length,
            part=np.zeros(POINTS, np.int32),
            binding_index=index.astype(np.int32)[:, None],
            binding_weight=ones[:, None],
            controller_points=points[:1] + np.array([0, 0, 0.02], np.float32),
            controller_springs=np.zeros((1, 2), np.int32),
            controller_rest_length=np.full(1, 0.02, np.float32),
        ),
        parameters=Parameters(
            stiffness=np.full(POINTS - 1, 60.0, np.float32),
            controller_stiffness=np.full(1, 300.0, np.float32),
            globals={name: Parameter(0.1, unit, "user") for name, unit in values.items()}
            | {"collision_distance": Parameter(0.0, "m", "user")},
        ),
    )


@pytest.fixture
def seen(rope) -> Observation:
    """What a rope does that is three times as stiff, under a hand that goes to and fro; with noise."""
    times = np.arange(FRAMES) / 30
    hand = np.repeat(rope.topology.controller_points[None], FRAMES, 0)
    hand[..., 0] += (0.06 * np.sin(8 * times)[:, None]).astype(np.float32)
    stiffer = replace(rope, parameters=replace(rope.parameters, stiffness=3.0 * rope.parameters.stiffness))
    points = stiffer.rollout(hand, times=times).points
    noise = np.random.default_rng(0).normal(0, 5e-4, points.shape)
    return Observation(times=times, points=(points + noise).astype(np.float32), controllers=hand)


@pytest.fixture
def worker(serving, tmp_path):
    environment = os.environ | {
        "REDIS_URL": serving.settings.redis_url,
        "STORE_URL": serving.settings.store_url,
        "MATPHYS_SCRATCH": str(tmp_path / "scratch"),
        "OMP_NUM_THREADS": "1",
    }
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen([sys.executable, "-m", "worker.main"], env=environment, stderr=log)
    yield process
    process.terminate()
    assert process.wait(40) == 0


@pytest.fixture
def twin(serving, rope, clip, tmp_path):
    """As if it had been made of a clip."""
    (tmp_path / "clip.mp4").write_bytes(clip)
    rope.save(tmp_path / "rope.twin.zip")
    with Client(serving.url, serving.keys.create("me", "default", SCOPES)[1]) as client:
        twin = client.submit(tmp_path / "clip.mp4")
        content = (tmp_path / "rope.twin.zip").read_bytes()
        serving.finish(twin.id, {"bundle.twin.zip": content}, tmp_path)
        yield client.twin(twin.id)


@pytest.mark.slow
def test_an_observation_is_diagnosed_and_its_report_fetched(twin, seen, worker, serving, tmp_path):
    write_observation(tmp_path / "seen.npz", seen)
    diagnosis = twin.diagnose(tmp_path / "seen.npz")
    told = []
    job = diagnosis.wait(lambda job: told.append((job.stage, job.progress)), timeout_s=300)
    stages = [stage for stage, _ in told if stage]
    shares = [share for _, share in told]
    assert [name for name in dict.fromkeys(stages) if name in STAGES] == list(STAGES)
    assert shares == sorted(shares)
    assert shares[-1] == 100
    # all but the first stage begin above zero; how many steps between are seen is a matter of polling
    assert len({share for share in shares if 0 < share < 100}) >= len(STAGES) - 1

    report = diagnosis.report()
    assert report.verdict.effect in (*EFFECT_NAMES, "none", "unknown")
    assert report.gap.refit < 0.5 * report.gap.baseline, "the stiffness was fitted"
    assert len(report.where.points) == POINTS
    assert job.metrics["effect"] == report.verdict.effect
    assert job.metrics["refit_m"] == report.gap.refit
    names = {file.name for file in job.files}
    assert {"report.json", "report.html"} <= names
    page = html.unescape(diagnosis.download("report.html", tmp_path / "report.html").read_text())
    # numbers and their units hang together on the page
    assert " ".join(report.verdict.statement.split()) in " ".join(page.split())
    assert ("diagnosed.twin.zip" in names) == (report.verdict.effect in EFFECT_NAMES)
    assert [each.id for each in twin.diagnoses()] == [diagnosis.id]


@pytest.mark.slow
def test_what_cannot_be_diagnosed_fails_with_the_reason(twin, seen, worker, tmp_path):
    still = np.repeat(seen.points[:1], FRAMES, 0)
    write_observation(tmp_path / "free.npz", replace(seen, points=still, controllers=seen.controllers[:, :0]))
    diagnosis = twin.diagnose(tmp_path / "free.npz")
    with pytest.raises(ServiceError, match="expected the hand that holds the object"):
        diagnosis.wait(timeout_s=120)
    assert diagnosis.job.status == "failed"
    assert not diagnosis.job.files
