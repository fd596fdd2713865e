import dataclasses
import json
import subprocess
import sys
import types
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model import cli
from model.bundle import TwinBundle
from model.errors import InputError
from model.formats import files
from model.schema import StageRecord


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch, twin_path: Path) -> types.SimpleNamespace:
    """A pipeline that answers at once with the foreign twin, or does what `act` does."""
    bundle = TwinBundle.load(twin_path)
    stage = StageRecord(name="segmentation", method="classical", version="1", warnings=["dark"])
    manifest = bundle.manifest.model_copy(update={"stages": (stage,), "warnings": ("segmentation: dark",)})
    module = types.SimpleNamespace(options=None, video=None, act=lambda: None)
    module.bundle = replace(bundle, manifest=manifest, preview=b"movie")

    def build_twin(video, options, report):
        module.video, module.options = video, options
        report("segmentation", 0.0)
        report("segmentation", 0.5)
        report("tracking", 0.75)
        module.act()
        return types.SimpleNamespace(bundle=module.bundle, seconds={"segmentation": 1.25, "tracking": 0.5})

    fake = types.ModuleType("model.pipeline")
    fake.TwinOptions = types.SimpleNamespace
    fake.build_twin = build_twin
    monkeypatch.setitem(sys.modules, "model.pipeline", fake)
    return module


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    (tmp_path / "clip.mp4").write_bytes(b"video")
    return tmp_path / "clip.mp4"


def test_help_needs_nothing_heavy():
    code = "import sys, model.cli, model.schema, model.bundle\n"
    code += "sys.exit('torch' in sys.modules or 'scipy' in sys.modules or 'cv2' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_version_and_help(run):
    assert run("--version").stdout.startswith("matphys, version 0.")
    helped = run()
    assert helped.code == 0
    assert all(name in helped.stdout for name in ("twin", "simulate", "export", "inspect"))
    assert run("twin", "--help").code == 0


class TestUsage:
    @pytest.mark.parametrize(
        ("arguments", "expected"),
        [
            (["fly"], "matphys: no such command 'fly'"),
            (["--fly"], "matphys: no such option"),
            (["twin"], "matphys twin: missing argument 'VIDEO'"),
            (["twin", "CLIP"], "matphys twin: missing option '--out'"),
            (["twin", "nowhere.mp4", "--out", "o"], "'nowhere.mp4' does not exist"),
            (["twin", "CLIP", "--out", "o", "--fly"], "matphys twin: no such option"),
            (["twin", "CLIP", "--out", "o", "--parts", "0"], "invalid value for '--parts'"),
            (["twin", "CLIP", "--out", "o", "--parts", "many"], "invalid value for '--parts'"),
            (["twin", "CLIP", "--out", "o", "--shape", "torus"], "invalid value for '--shape'"),
            (["twin", "CLIP", "--out", "o", "--box", "1,2,3"], "is not of the form x,y,w,h"),
            (["twin", "CLIP", "--out", "o", "--box", "1,2,0,4"], "has no area"),
            (["twin", "CLIP", "--out", "o", "--mask", "no.png"], "'no.png' does not exist"),
            (["simulate", "CLIP"], "matphys simulate: missing option '--out'"),
            (["simulate", "CLIP", "--out", "o.npz", "--substeps", "0"], "invalid value for '--substeps'"),
            (["export", "CLIP", "--out", "o"], "matphys export: missing option '--to'"),
        ],
    )
    def test_one_line_and_two(self, run, clip: Path, arguments: list[str], expected: str):
        outcome = run(*(clip if argument == "CLIP" else argument for argument in arguments))
        assert outcome.code == 2
        assert expected in outcome.line


class TestTwin:
    def test_writes_the_twin(self, run, pipeline, clip: Path, tmp_path: Path):
        out = tmp_path / "deep" / "a.twin.zip"
        outcome = run("twin", clip, "--out", out)
        assert outcome.code == 0
        assert pipeline.video == clip
        assert vars(pipeline.options) == {}
        np.testing.assert_array_equal(TwinBundle.load(out).topology.mass, pipeline.bundle.topology.mass)
        assert f"wrote {out}" in outcome.stdout
        assert "classical" in outcome.stdout
        assert "1.25" in outcome.stdout
        assert "seconds" in outcome.stdout
        lines = outcome.stderr.splitlines()
        assert [line.split()[-1] for line in lines[:2]] == ["segmentation", "tracking"]
        assert lines[2:] == ["warning: segmentation: dark"]

    def test_measured_seconds_stay_out_of_the_bundle(self, run, pipeline, clip: Path, tmp_path: Path):
        run("twin", clip, "--out", tmp_path / "a.twin.zip")
        assert TwinBundle.load(tmp_path / "a.twin.zip").manifest.stages[0].seconds is None
        assert "seconds" not in run("inspect", tmp_path / "a.twin.zip").stdout

    def test_json_is_alone_on_stdout(self, run, pipeline, clip: Path, tmp_path: Path):
        outcome = run("twin", clip, "--out", tmp_path / "a.twin.zip", "--json")
        result = json.loads(outcome.stdout)
        assert result["twin"] == str(tmp_path / "a.twin.zip")
        assert result["seconds"] == {"segmentation": 1.25, "tracking": 0.5}
        assert result["counts"]["points"] == 27
        assert result["warnings"] == ["segmentation: dark"]

    def test_quiet(self, run, pipeline, clip: Path, tmp_path: Path):
        outcome = run("twin", clip, "--out", tmp_path / "a.twin.zip", "--quiet")
        assert (outcome.code, outcome.stdout, outcome.stderr) == (0, "", "")

    def test_warnings_of_the_work_are_said_once_at_the_end(self, run, pipeline, clip: Path, tmp_path: Path):
        def warn() -> None:
            for _ in range(3):
                warnings.warn("the renderer is slow", UserWarning, stacklevel=1)
                warnings.warn("old name", DeprecationWarning, stacklevel=1)

        pipeline.act = warn
        lines = run("twin", clip, "--out", tmp_path / "a.twin.zip").stderr.splitlines()
        assert lines[2:] == ["warning: segmentation: dark", "warning: the renderer is slow"]

    def test_preview(self, run, pipeline, clip: Path, tmp_path: Path):
        run("twin", clip, "--out", tmp_path / "a.twin.zip", "--preview", tmp_path / "a.mp4")
        assert (tmp_path / "a.mp4").read_bytes() == b"movie"

    def test_options_reach_the_pipeline(self, run, pipeline, clip: Path, tmp_path: Path):
        for name in ("m.png", "m.glb", "c.json", "c.npz"):
            (tmp_path / name).touch()
        text = f"--mask {tmp_path}/m.png --box 1,2,30,40 --mesh {tmp_path}/m.glb "
        text += f"--camera {tmp_path}/c.json "
        text += f"--controllers {tmp_path}/c.npz --size-m 0.3 --prior openai --parts 3 --depth {tmp_path} "
        text += "--segmentation sam2 --tracking cotracker --reconstruction mesh --encoder dinov2 "
        text += "--renderer splat "
        text += "--fps 12 --keyframe 4 --seed 9 --shape rope --points 500"
        assert run("twin", clip, "--out", tmp_path / "a.twin.zip", *text.split()).code == 0
        assert vars(pipeline.options) == {
            "mask": tmp_path / "m.png",
            "box": (1, 2, 30, 40),
            "mesh": tmp_path / "m.glb",
            "camera": tmp_path / "c.json",
            "controllers": tmp_path / "c.npz",
            "depth": tmp_path,
            "size_m": 0.3,
            "prior": "openai",
            "parts": 3,
            "segmentation": "sam2",
            "tracking": "cotracker",
            "reconstruction": "mesh",
            "encoder": "dinov2",
            "renderer": "splat",
            "fps": 12.0,
            "keyframe": 4,
            "seed": 9,
            "shape": "rope",
            "points": 500,
        }

    def test_options_are_those_of_the_pipeline(self):
        from model.pipeline import TwinOptions

        ours = {parameter.name for parameter in cli.twin.params}
        fields = {field.name for field in dataclasses.fields(TwinOptions)}
        assert ours - {"video", "out", "preview", "as_json", "quiet"} == fields

    @pytest.mark.parametrize(
        ("error", "code", "line"),
        [
            (InputError("clip.mp4: one frame:\nfilm more"), 2, "matphys: clip.mp4: one frame: film more"),
            (RuntimeError("oops"), 1, "matphys: internal error: RuntimeError: oops (set MATPHYS_DEBUG=1"),
            (EOFError("in x"), 1, "matphys: internal error: RuntimeError: a file ended where more was exp"),
        ],
    )
    def test_a_failure_leaves_nothing(self, run, pipeline, clip: Path, tmp_path: Path, error, code, line):
        def fail() -> None:
            raise error

        pipeline.act = fail
        outcome = run("twin", clip, "--out", tmp_path / "new" / "a.twin.zip", "--quiet")
        assert outcome.code == code
        assert outcome.line.startswith(line)
        assert not (tmp_path / "new").exists()

    def test_debug_shows_the_traceback(self, run, pipeline, clip: Path, tmp_path: Path):
        def fail() -> None:
            raise RuntimeError("oops")

        pipeline.act = fail
        outcome = run("--debug", "twin", clip, "--out", tmp_path / "a.twin.zip")
        assert outcome.code == 1
        assert "Traceback" in outcome.stderr

    def test_interrupted(self, run, pipeline, clip: Path, tmp_path: Path):
        def interrupt() -> None:
            raise KeyboardInterrupt

        pipeline.act = interrupt
        outcome = run("twin", clip, "--out", tmp_path / "a.twin.zip", "--quiet")
        assert outcome.code == 130
        assert outcome.stdout == ""
        assert outcome.stderr.strip() == ""
        assert not (tmp_path / "a.twin.zip").exists()

    def test_a_full_disk_leaves_the_old_twin(self, run, pipeline, clip: Path, tmp_path: Path, monkeypatch):
        out = tmp_path / "out" / "a.twin.zip"
        run("twin", clip, "--out", out)
        old = out.read_bytes()

        def full(path: Path) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(files, "_sync", full)
        outcome = run("twin", clip, "--out", out, "--quiet")
        assert outcome.code == 1
        assert "No space left on device" in outcome.line
        assert out.read_bytes() == old
        assert list(out.parent.iterdir()) == [out]

    @pytest.mark.parametrize("option", ["--out", "--preview"])
    def test_the_clip_is_never_overwritten(self, run, pipeline, clip: Path, tmp_path: Path, option: str):
        outcome = run("twin", clip, "--out", tmp_path / "a.twin.zip", option, clip)
        assert outcome.code == 2
        assert "is the input" in outcome.line
        assert pipeline.video is None
        assert clip.read_bytes() == b"video"

    @pytest.mark.parametrize("option", ["--mask", "--controllers", "--predictor"])
    def test_nothing_that_is_read_is_overwritten(
        self, run, pipeline, clip: Path, tmp_path: Path, option: str
    ):
        other = tmp_path / "other.safetensors"
        other.write_bytes(b"mine")
        outcome = run("twin", clip, "--out", tmp_path / "a.twin.zip", option, other, "--preview", other)
        assert outcome.code == 2
        assert "is read by this command" in outcome.line
        assert pipeline.video is None
        assert other.read_bytes() == b"mine"

    def test_impossible_outputs_are_refused_before_the_work(self, run, pipeline, clip: Path, tmp_path: Path):
        assert "it is a folder" in run("twin", clip, "--out", tmp_path).line
        assert "is not a folder" in run("twin", clip, "--out", clip / "a.twin.zip").line
        assert pipeline.video is None


class TestInspect:
    def test_tables(self, run, write_twin):
        parts = [
            {
                "label": "[red]head[/red]\x1b[2J",
                "materials": {"fur": 1.0},
                "size": {"points": 9, "mass": 0.05},
            }
        ] * 2
        outcome = run("inspect", write_twin(files={"parts.json": json.dumps(parts).encode()}))
        assert outcome.code == 0
        for word in (
            "check",
            "Parameters",
            "drag_rate",
            "[red]head[/red]",
            "fur 100%",
            "50 g",
            "5 at 30 fps",
        ):
            assert word in outcome.stdout
        assert "\x1b" not in outcome.stdout

    def test_stages_metrics_effects_and_warnings(self, run, write_twin):
        stage = {
            "name": "tracking",
            "method": "opencv",
            "version": "1",
            "seconds": 1.5,
            "warnings": ["blurred"],
        }
        manifest = {"schema": "matphys.twin/1", "stages": [stage], "warnings": ["tracking: blurred"]}
        manifest["metrics"] = {"keyframe_iou": 0.98765, "overlap": [0.5, 0.7]}
        effects = [{"name": "wind", "parameters": {"drag_per_mass": 0.5, "x": 1.5, "y": 0.0}}]
        contents = {"twin.json": json.dumps(manifest).encode(), "effects.json": json.dumps(effects).encode()}
        outcome = run("inspect", write_twin(files=contents))
        assert outcome.code == 0
        for words in ("opencv", "1.50", "0.9877", "mean 0.6 over 2", "wind", "tracking: blurred"):
            assert words in outcome.stdout

    def test_json(self, run, twin_path: Path, tensors):
        result = json.loads(run("inspect", twin_path, "--json").stdout)
        assert result["schema"] == "matphys.twin/1"
        assert result["counts"]["springs"] == len(tensors["springs"])
        assert result["counts"]["control_frames"] == 5
        assert result["mass"] == pytest.approx(tensors["mass"].sum())
        assert result["parameters"]["drag_rate"]["value"] == 0.8

    def test_a_broken_twin(self, run, twin_path: Path):
        twin_path.write_text("hello")
        outcome = run("inspect", twin_path)
        assert outcome.code == 2
        assert "expected a zip archive" in outcome.line
