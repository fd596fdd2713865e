"""A whole clip becomes a whole twin."""

import json
import os
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from model.bundle import TwinBundle
from model.errors import InputError
from model.pipeline import TwinOptions, TwinResult, build_twin
from model.pipeline.twin import SHARES
from model.predictor.trained import TrainedPredictor
from model.simulator.divergence import SimulationDiverged

POINTS = 150


@pytest.fixture(scope="module")
def built(plush_clip) -> tuple[TwinResult, list[tuple[str, float]]]:
    told: list[tuple[str, float]] = []
    result = build_twin(
        plush_clip.path, TwinOptions(points=POINTS), lambda stage, share: told.append((stage, share))
    )
    return result, told


@pytest.fixture(scope="module")
def bundle(built) -> TwinBundle:
    return built[0].bundle


@pytest.fixture(scope="module")
def saved(bundle: TwinBundle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("twin") / "plush.twin.zip"
    bundle.save(path)
    return path


def members(path: Path) -> dict[str, bytes]:
    """Of a bundle, without the moment of its making."""
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    manifest = json.loads(content["twin.json"])
    assert manifest.pop("created")
    return content | {"twin.json": json.dumps(manifest).encode()}


def test_the_stages_run_in_order_and_say_how_far_they_are(built):
    result, told = built
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[-1] == ("done", 1.0)
    names = [record.name for record in result.bundle.manifest.stages]
    assert names == list(SHARES)
    assert set(result.seconds) == set(names)
    assert all(record.method and record.version for record in result.bundle.manifest.stages)


def test_the_twin_looks_like_the_keyframe_and_follows_the_hand(bundle: TwinBundle):
    metrics = bundle.manifest.metrics
    assert metrics["keyframe_iou"] >= 0.9
    assert metrics["silhouette_iou"] >= 0.8
    per_frame = metrics["silhouette_iou_per_frame"]
    assert len(per_frame) == 12
    assert np.mean(per_frame) == pytest.approx(metrics["silhouette_iou"], abs=1e-3)
    assert per_frame[0] == metrics["keyframe_iou"]
    assert abs(metrics["points"] - POINTS) <= 0.2 * POINTS
    assert metrics["springs"] == len(bundle.topology.springs)
    assert metrics["gaussians"] == len(bundle.gaussians)
    assert any("stub" in warning for warning in bundle.manifest.warnings)


def test_the_saved_twin_rolls_out_and_stays_above_the_table(saved: Path):
    twin = TwinBundle.load(saved)
    assert twin.preview is not None
    height = twin.rollout().points[..., 2]
    ground = twin.parameters.globals["ground_height"].value
    assert height.min() > ground - 1e-3
    assert height[0].min() < ground + 0.01  # it lies on the table
    assert height[-1].max() > height[0].max() + 0.02  # and is lifted


def test_let_go_it_falls_onto_the_table_and_rests(bundle: TwinBundle):
    free = replace(
        bundle.topology,
        points=bundle.topology.points + np.float32([0, 0, 0.1]),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    loose = replace(bundle.parameters, controller_stiffness=np.zeros(0, np.float32))
    twin = replace(bundle, topology=free, parameters=loose, controls=None)
    trajectory = twin.rollout(times=np.arange(46) / 30)
    height = trajectory.points[..., 2]
    ground = bundle.parameters.globals["ground_height"].value
    drop = height[0].mean() - height[3].mean()
    assert drop == pytest.approx(9.81 / 2 * 0.1**2, rel=0.15)
    assert height.min() > ground - 1e-3
    assert height[-1].min() < ground + 1e-3
    assert np.abs(height[-1] - height[-3]).max() < 2e-3


def test_same_input_same_bytes_in_another_process(plush_clip, saved: Path, tmp_path: Path):
    """In another process, so with another layout of memory and other hashes; and by the command line."""
    out, preview = tmp_path / "again.twin.zip", tmp_path / "again.mp4"
    command = [sys.executable, "-c", "import sys; from model.cli import main; sys.exit(main())"]
    command += ["twin", str(plush_clip.path), "--out", str(out), "--points", str(POINTS), "--quiet"]
    command += ["--preview", str(preview)]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONHASHSEED": "123"}, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    first, second = members(saved), members(out)
    assert list(first) == list(second)
    assert [name for name in first if first[name] != second[name]] == []
    assert preview.read_bytes() == first["preview.mp4"]


def test_where_the_network_fails_the_means_are_taken_and_it_says_why(plush_clip, monkeypatch):
    def diverge(self, case, images=None):
        raise SimulationDiverged(3, 7, "spring", 100)

    monkeypatch.setattr(TrainedPredictor, "__call__", diverge)
    twin = build_twin(plush_clip.path, TwinOptions(points=POINTS), lambda stage, share: None).bundle
    line = "parameters: the prior's means are used, not matphys: the simulation diverged in frame 3"
    assert any(warning.startswith(line) for warning in twin.manifest.warnings)
    assert twin.parameters.globals["friction"].source == "prior"


@pytest.fixture(scope="module")
def wishes(plush_clip, bundle: TwinBundle, tmp_path_factory: pytest.TempPathFactory) -> TwinOptions:
    """Everything that a user may say about a clip; the hand is said to move sideways, at the fifth frame."""
    folder = tmp_path_factory.mktemp("wishes")
    mask = plush_clip.things[4].copy()
    mask[:, :80] = False  # as if it were only its right half
    cv2.imwrite(str(folder / "mask.png"), mask.astype(np.uint8) * 255)
    source = bundle.manifest.source.camera
    camera = {"intrinsics": source.intrinsics, "world_from_camera": source.world_from_camera}
    (folder / "camera.json").write_text(json.dumps(camera | {"ground_height": 0.0}))
    way = np.linspace(0, 0.05, 8)[:, None, None] * np.array([1.0, 0, 0])
    held = bundle.topology.controller_points[:2]
    np.savez(folder / "controllers.npz", controllers=held + way)
    return TwinOptions(
        mask=folder / "mask.png",
        keyframe=4,
        camera=folder / "camera.json",
        controllers=folder / "controllers.npz",
        shape="sheet",
        parts=2,
        points=POINTS,
    )


def test_what_the_user_says_counts(plush_clip, wishes: TwinOptions, bundle: TwinBundle):
    twin = build_twin(plush_clip.path, wishes, lambda stage, share: None).bundle
    methods = {record.name: record.method for record in twin.manifest.stages}
    assert twin.manifest.id != bundle.manifest.id
    assert twin.manifest.source.keyframe == 4
    assert methods["shape"] == methods["controllers"] == "user"
    assert methods["calibration"] == "camera file"
    assert twin.manifest.source.camera.intrinsics == bundle.manifest.source.camera.intrinsics
    assert len(twin.parts) == 2
    assert twin.gaussians.volumes.sum() < 0.3 * bundle.gaussians.volumes.sum()  # a sheet, and half of it
    with np.load(wishes.controllers) as given:
        np.testing.assert_allclose(twin.controls, given["controllers"], atol=1e-6)
    x = twin.rollout().points[..., 0]
    assert x[-1].mean() > x[0].mean() + 0.01


def test_a_hand_that_is_nowhere_near_the_object_is_refused(plush_clip, wishes: TwinOptions, tmp_path: Path):
    with np.load(wishes.controllers) as given:
        np.savez(tmp_path / "mm.npz", controllers=1000 * given["controllers"])
    away = replace(wishes, controllers=tmp_path / "mm.npz")
    with pytest.raises(InputError, match=r"mm.npz: none of its 2 controllers starts at the object"):
        build_twin(plush_clip.path, away, lambda stage, share: None)


def test_a_box_and_a_size_are_enough_to_say(plush_clip):
    options = TwinOptions(box=(55, 50, 85, 75), size_m=0.6, points=POINTS, keyframe=0)
    twin = build_twin(plush_clip.path, options, lambda stage, share: None).bundle
    angle = np.linspace(0, np.pi, 90)
    widths = np.ptp(twin.gaussians.means[:, :2] @ np.stack([np.cos(angle), np.sin(angle)]), axis=0)
    assert widths.max() == pytest.approx(0.6, rel=0.1)
    assert twin.manifest.metrics["keyframe_iou"] >= 0.9


def test_a_wrong_name_costs_no_work(tmp_path: Path):
    told: list[str] = []
    wish = TwinOptions(segmentation="magic")
    with pytest.raises(InputError, match="unknown segmentation method 'magic'"):
        build_twin(tmp_path / "none.mp4", wish, lambda stage, share: told.append(stage))
    assert told == []
