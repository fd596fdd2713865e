"""The command around a stand-in for the diagnosis, which has tests of its own."""

import json
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model import cli
from model.bundle import TwinBundle
from model.gap.carried import record_of
from model.gap.diagnosis import Diagnosis
from model.gap.effects import SteadyWind
from model.observation import write_observation
from model.types import Observation

FRAMES = 20
WIND = record_of(SteadyWind, {"drag_per_mass": 1.0, "x": 3.0, "y": 0.0, "facing": 0.5})
FILES = {"report.json", "report.html"}


@pytest.fixture
def diagnosis(monkeypatch, found):
    """Finds wind, or what `effect` says, and remembers what it was asked."""
    asked = types.SimpleNamespace(effect="wind", effects=(WIND,))

    def diagnose(observation, twin=None, transfer=None, progress=None):
        asked.observation, asked.twin, asked.transfer = observation, twin, transfer
        progress("fit", 0.25)
        progress("screen", 0.5)
        return Diagnosis(found(observation, asked.effect), asked.effects)

    module = types.ModuleType("model.gap.diagnose")
    module.diagnose = diagnose
    monkeypatch.setitem(sys.modules, "model.gap.diagnose", module)
    return asked


@pytest.fixture
def seen(twin_path) -> Observation:
    """The foreign twin under a hand that moves on."""
    twin = TwinBundle.load(twin_path)
    times = np.arange(FRAMES) / 30
    hand = np.repeat(twin.controls[:1], FRAMES, 0)
    hand[..., 0] += 0.03 * np.sin(6 * times)[:, None]
    points = twin.rollout(hand, times=times, substeps=60).points
    return Observation(times=times, points=points, controllers=hand.astype(np.float32))


@pytest.fixture
def file(seen, tmp_path) -> Path:
    write_observation(tmp_path / "o.npz", seen)
    return tmp_path / "o.npz"


@pytest.fixture
def run(capfd, monkeypatch):
    monkeypatch.delenv("MATPHYS_DEBUG", raising=False)

    def call(*arguments: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = cli.main(["diagnose", *(str(argument) for argument in arguments)])
        return code, *capfd.readouterr()

    return call


def test_writes_the_report_and_says_what_it_found(run, diagnosis, file, tmp_path):
    code, out, err = run(file, "--out", tmp_path / "gap")
    assert code == 0
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["verdict"]["effect"] == "wind"
    assert out.splitlines()[0] == report["verdict"]["statement"] != ""
    written = {path.name for path in (tmp_path / "gap").iterdir()}
    assert written >= FILES
    assert {Path(line.removeprefix("wrote ")).name for line in out.splitlines()[1:]} == written
    assert [line.split()[-1] for line in err.splitlines()[:3]] == ["observation", "fit", "screen"]
    assert "warning: said by the diagnosis" in err
    assert not diagnosis.twin.given
    assert diagnosis.transfer is None


def test_json_is_alone_on_stdout(run, diagnosis, file, tmp_path):
    code, out, err = run(file, "--out", tmp_path / "gap", "--json", "--quiet")
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert result["verdict"]["effect"] == "wind"
    assert result["gap"]["refit"] == 0.011
    assert result["warnings"][0] == "said by the diagnosis"
    assert all(Path(name).is_file() for name in result["files"])


def test_the_twin_that_was_given_is_questioned_and_gets_the_effect(run, diagnosis, file, twin_path, tmp_path):
    saved = tmp_path / "with.twin.zip"
    code, out, _ = run(file, "--twin", twin_path, "--out", tmp_path / "gap", "--save-twin", saved)
    assert code == 0
    assert f"wrote {saved}" in out
    np.testing.assert_array_equal(diagnosis.twin.body.springs, TwinBundle.load(twin_path).topology.springs)
    assert TwinBundle.load(saved).effects == (WIND,)
    code, out, _ = run(file, "--twin", saved, "--out", tmp_path / "again", "--quiet")
    assert code == 0
    assert diagnosis.twin.carried == (WIND,)


@pytest.mark.parametrize("kind", ["observation", "transfer"])
def test_a_clip_is_no_observation_yet(run, diagnosis, file, tmp_path, kind):
    clip = tmp_path / "clip.mp4"
    clip.write_bytes(b"\0")
    given = (clip,) if kind == "observation" else (file, "--transfer", clip)
    code, _, err = run(*given, "--out", tmp_path / "gap")
    assert code == 2
    assert "clip.mp4: expected an observation, a .npz: `matphys observe` makes one of a clip" in err
    assert not (tmp_path / "gap").exists()


def test_without_a_twin_one_is_made(run, diagnosis, file, tmp_path):
    saved = tmp_path / "made.twin.zip"
    assert run(file, "--out", tmp_path / "gap", "--save-twin", saved, "--quiet")[0] == 0
    twin = TwinBundle.load(saved)
    assert WIND in twin.effects
    assert np.isfinite(twin.rollout(substeps=100).points).all()


@pytest.mark.parametrize("effect", ["none", "unknown"])
def test_a_verdict_without_an_effect_writes_no_twin(run, diagnosis, file, tmp_path, effect):
    diagnosis.effect, diagnosis.effects = effect, ()
    code, _, err = run(file, "--out", tmp_path / "gap", "--save-twin", tmp_path / "x.twin.zip")
    assert code == 0
    assert "x.twin.zip was not written: the verdict names no effect" in err
    assert not (tmp_path / "x.twin.zip").exists()


def test_what_was_not_written_is_said_in_json_too(run, diagnosis, file, tmp_path):
    diagnosis.effect, diagnosis.effects = "none", ()
    arguments = ("--out", tmp_path / "gap", "--save-twin", tmp_path / "x.twin.zip", "--json", "--quiet")
    code, out, _ = run(file, *arguments)
    assert code == 0
    assert any("x.twin.zip was not written" in line for line in json.loads(out)["warnings"])


def test_a_second_interaction_is_passed_on(run, diagnosis, file, seen, tmp_path):
    slower = replace(seen, times=2 * seen.times, points=seen.points + np.float32(1e-3))
    write_observation(tmp_path / "other.npz", slower)
    assert run(file, "--transfer", tmp_path / "other.npz", "--out", tmp_path / "gap", "--quiet")[0] == 0
    np.testing.assert_array_equal(diagnosis.transfer.times, 2 * seen.times)


def test_the_same_motion_again_is_no_second_interaction(run, file, tmp_path):
    code, _, said = run(file, "--transfer", file, "--out", tmp_path / "gap", "--quiet")
    assert code == 2
    assert "the same motion again" in said
    assert not (tmp_path / "gap").exists()


def test_what_is_doubtful_about_the_input_is_in_the_report(run, diagnosis, file, seen, tmp_path):
    blind = seen.points.copy()
    blind[3:, 0] = np.nan
    blind[5] = np.nan
    write_observation(file, replace(seen, points=blind[:, :20]))
    assert run(file, "--out", tmp_path / "gap", "--quiet")[0] == 0
    warnings = json.loads((tmp_path / "gap" / "report.json").read_text())["warnings"]
    assert "o.npz: points: nothing is seen in 1 of 20 frames" in warnings


class TestRefused:
    """Nothing is diagnosed, nothing written, one line said."""

    @pytest.fixture
    def refused(self, run, diagnosis, file, tmp_path):
        def call(*more: object, **changes: object) -> str:
            arrays = {**np.load(file)} | changes
            np.savez(file, **arrays)
            before = set(tmp_path.rglob("*"))
            code, out, err = run(file, "--out", tmp_path / "gap", *more, "--quiet")
            assert (code, out) == (2, "")
            assert err.count("\n") == 1
            assert set(tmp_path.rglob("*")) == before
            assert not hasattr(diagnosis, "observation")
            return err

        return call

    def test_nothing_seen(self, refused, seen):
        assert "points: expected some points seen, found NaN everywhere" in refused(
            points=seen.points * np.nan
        )

    def test_one_frame(self, refused, seen):
        line = refused(times=seen.times[:1], points=seen.points[:1], controllers=seen.controllers[:1])
        assert "times: expected at least 2 frames, found 1" in line

    def test_few_frames(self, refused, seen):
        line = refused(times=seen.times[:8], points=seen.points[:8], controllers=seen.controllers[:8])
        assert "times: expected at least 12 frames to diagnose, found 8" in line

    def test_times_that_go_back(self, refused, seen):
        times = seen.times.copy()
        times[7] = times[6]
        assert "times: expected strictly increasing seconds" in refused(times=times)

    def test_millimetres(self, refused, seen):
        line = refused(points=1000 * seen.points, controllers=1000 * seen.controllers)
        assert "millimetres?" in line

    @pytest.mark.parametrize("shift", [None, 3.0])
    def test_a_hand_that_is_missing_or_elsewhere(self, refused, seen, shift):
        hand = seen.controllers[:, :0] if shift is None else seen.controllers + np.float32(shift)
        assert "controllers: expected the hand that holds the object" in refused(controllers=hand)

    def test_a_transfer_that_cannot_be_used(self, refused, tmp_path):
        (tmp_path / "other.npz").write_bytes(b"PK")
        assert "other.npz" in refused("--transfer", tmp_path / "other.npz")

    def test_a_twin_of_another_object(self, refused, write_twin, tensors):
        other = write_twin("other.twin.zip", points=20 * tensors["points"])
        assert "is it the twin of this object" in refused("--twin", other)

    def test_a_report_where_a_file_is(self, refused, tmp_path):
        (tmp_path / "gap").write_text("mine")
        assert "gap is a file: give a folder for the report" in refused()

    def test_a_twin_over_the_twin(self, refused, twin_path):
        assert "is the twin that is questioned" in refused("--twin", twin_path, "--save-twin", twin_path)

    def test_a_twin_over_the_observation(self, refused, file):
        assert "is the input" in refused("--save-twin", file)

    @pytest.mark.parametrize("name", ["gap", "gap/report.json", "gap/place.png"])
    def test_a_twin_where_the_report_goes(self, refused, tmp_path, name):
        assert "give the output another name" in refused("--save-twin", tmp_path / name)

    def test_a_report_below_the_twin(self, refused, tmp_path):
        line = refused("--save-twin", tmp_path / "a.twin.zip", "--out", tmp_path / "a.twin.zip" / "gap")
        assert "give the output another name" in line

    @pytest.mark.parametrize("name", ["report.html", "rollouts.png"])
    def test_a_folder_where_a_file_of_the_report_goes(self, refused, tmp_path, name):
        (tmp_path / "gap" / name).mkdir(parents=True)
        assert f"{name}: it is a folder" in refused()
