"""The whole of a diagnosis by its command, with a jury that is sure of drag: what is fitted and written."""

import json
from dataclasses import replace

import numpy as np
import pytest

from model import cli
from model.bundle import TwinBundle
from model.gap.carried import record_of
from model.gap.effects import GravityTilt
from model.observation import write_observation
from model.types import Observation, Parameter

FRAMES = 24
TRUTH = record_of(GravityTilt, {"about_x": 0.3, "about_y": -0.1})


@pytest.fixture
def twin(twin_path) -> TwinBundle:
    """The foreign cube, without contact among its points."""
    bundle = TwinBundle.load(twin_path)
    free = {**bundle.parameters.globals, "collision_distance": Parameter(0.0, "m", "user")}
    twin = replace(bundle, parameters=replace(bundle.parameters, globals=free))
    twin.save(twin_path)
    return twin


def seen(twin: TwinBundle, pace: float) -> Observation:
    """What a twin does in tilted gravity under a hand that goes to and fro, with noise; every other point."""
    times = np.arange(FRAMES) / 30
    hand = np.repeat(twin.topology.controller_points[None], FRAMES, 0)
    hand[..., 0] += (0.05 * np.sin(pace * times)[:, None]).astype(np.float32)
    points = replace(twin, effects=(TRUTH,)).rollout(hand, times=times).points[:, ::2]
    noise = np.random.default_rng(0).normal(0, 5e-4, points.shape)
    return Observation(times=times, points=(points + noise).astype(np.float32), controllers=hand)


def error(twin: TwinBundle, observation: Observation) -> float:
    """Mean distance of an open-loop rollout [m]."""
    points = twin.rollout(observation.controllers, times=observation.times).points[:, ::2]
    return float(np.linalg.norm(points - observation.points, axis=-1).mean())


@pytest.mark.slow
def test_a_twin_is_questioned_and_mended(twin, twin_path, tmp_path, capfd):
    first, second = seen(twin, 9.0), seen(twin, 6.0)
    write_observation(tmp_path / "seen.npz", first)
    write_observation(tmp_path / "other.npz", second)
    arguments = [
        *("diagnose", tmp_path / "seen.npz", "--twin", twin_path, "--transfer", tmp_path / "other.npz"),
        *("--out", tmp_path / "gap", "--save-twin", tmp_path / "mended.twin.zip"),
    ]
    assert cli.main([str(word) for word in arguments]) == 0, capfd.readouterr().err
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["verdict"]["effect"] == "gravity_tilt"
    assert report["gap"]["with_effect"] < 0.3 * report["gap"]["refit"]
    assert report["gap"]["transfer"] is not None
    mended = TwinBundle.load(tmp_path / "mended.twin.zip")
    assert [record.name for record in mended.effects] == ["gravity_tilt"]
    assert error(mended, first) < 0.25 * error(twin, first)
    assert error(mended, second) < 0.25 * error(twin, second)
    stages = [line.split()[-1] for line in capfd.readouterr().err.splitlines() if "%" in line]
    assert stages[:3] == ["observation", "refit", "screen"]
    assert stages[-1] == "done"
