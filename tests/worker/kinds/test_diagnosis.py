from pathlib import Path
from types import SimpleNamespace

import pytest

from model.doubts import collect_doubts
from model.errors import InputError
from worker.kinds.diagnosis import DIAGNOSED, OBSERVED, DiagnosisKind
from worker.record import JobRecord

GAP = {"baseline": 0.02, "refit": 0.011, "with_effect": 0.003, "noise_floor": 0.001, "closed_fraction": 0.8}


class Result:
    """What the pipeline gives: one warning, two files, a twin where an effect was named."""

    def __init__(self, effect):
        verdict = {"effect": effect, "probability": 0.9}
        dumped = {"verdict": verdict, "gap": GAP | {"metric": "track_error_m"}}
        self.report = SimpleNamespace(warnings=("little light",), model_dump=lambda mode: dumped)
        self.effect = effect

    def write_report(self, folder):
        for name in ("report.json", "report.html"):
            (folder / name).write_text(name)
        return folder / "report.json", folder / "report.html"

    def twin(self):
        return None if self.effect == "none" else SimpleNamespace(save=lambda path: path.write_text("twin"))


@pytest.fixture
def make_run(tmp_path):
    def make(effect="wind", parent=True, **inputs):
        asked = []

        def diagnose(observation, twin, transfer, report):
            asked.append((observation, twin.name, transfer))
            report("fit", 0.5)
            return Result(effect)

        def observe(video, twin, segmentation, tracking, mask, report):
            asked.append((video, twin.name, segmentation, tracking, mask))
            report("tracking", 0.5)
            return "seen"

        modules = {
            "pipeline": SimpleNamespace(diagnose=diagnose, observe=observe),
            "observation": SimpleNamespace(write_observation=lambda path, seen: path.write_text(seen)),
            "doubts": SimpleNamespace(collect_doubts=collect_doubts),
        }
        twin = JobRecord(id="1", kind="twin", queue="twins", tenant="a")
        logged, told = [], []
        return SimpleNamespace(
            parent=twin if parent else None,
            record=JobRecord(
                id="2", kind="diagnosis", queue="twins", tenant="a", options={"tracking": "cotracker"}
            ),
            folder=tmp_path,
            inputs={name: Path(file) for name, file in inputs.items()},
            fetch=lambda record, name: tmp_path / name,
            log=logged.append,
            logged=logged,
            report=lambda stage, share: told.append((stage, round(share, 3))),
            told=told,
            model=modules.__getitem__,
            asked=asked,
        )

    return make


def test_an_observation_is_diagnosed_against_its_twin(make_run):
    run = make_run(observation="seen.npz", transfer="other.npz")
    outcome = DiagnosisKind().run(run)
    assert run.asked == [(Path("seen.npz"), "bundle.twin.zip", Path("other.npz"))]
    assert [path.name for path in outcome.files] == ["report.json", "report.html", DIAGNOSED]
    assert all(path.is_file() for path in outcome.files)
    assert outcome.metrics["effect"] == "wind"
    assert (outcome.metrics["refit_m"], outcome.metrics["closed_fraction"]) == (0.011, 0.8)
    assert run.logged == ["warning: little light"]
    assert run.told == [("fit", 0.5)]


def test_a_video_is_observed_first(make_run):
    run = make_run(video="clip.mp4", mask="mask.png")
    outcome = DiagnosisKind().run(run)
    looked, diagnosed = run.asked
    assert looked == (Path("clip.mp4"), "bundle.twin.zip", "classical", "cotracker", Path("mask.png"))
    assert diagnosed[0].read_text() == "seen"
    assert outcome.files[0].name == OBSERVED
    assert run.told == [("tracking", 0.15), ("fit", 0.65)]


def test_where_nothing_is_missing_there_is_no_further_twin(make_run):
    outcome = DiagnosisKind().run(make_run("none", observation="seen.npz"))
    assert [path.name for path in outcome.files] == ["report.json", "report.html"]


def test_without_its_twin_there_is_no_diagnosis(make_run):
    with pytest.raises(InputError, match="the twin is gone"):
        DiagnosisKind().run(make_run(parent=False, observation="seen.npz"))
