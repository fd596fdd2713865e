"""What is diagnosed of a recording, and what is said of the rest."""

import json

import numpy as np
import pytest

from benchmarks.gap.cantilever import Cantilever
from model.gap.diagnosis import Diagnosis
from model.gap.report.findings import Findings
from model.gap.schema import EFFECT_NAMES, SCHEMA, GapReport
from model.observation import write_observation
from model.pipeline import diagnose


class Asked(Exception):
    """Ends a diagnosis where it would begin."""


@pytest.fixture
def beam(tmp_path):
    """A file of a beam that is held straight for a while by a finger that the recording does not know of."""

    def made(held):
        seen = Cantilever().recording(1.2, held)
        rng = np.random.default_rng(0)
        seen.points[:] += rng.normal(0, 1e-5, seen.points.shape).astype(np.float32)
        write_observation(tmp_path / "beam.npz", seen)
        return tmp_path / "beam.npz", seen

    return made


def healthy(observation, twin, transfer, progress):
    """Stands in for a diagnosis: nothing is missing."""
    frames, count = observation.points.shape[:2]
    gap = {"baseline": 0.02, "refit": 0.01, "noise_floor": 0.002, "heldout": [[0.1, 0.2]]}
    report = GapReport.model_validate(
        {
            "schema": SCHEMA,
            "verdict": {"effect": "none", "probability": 0.9, "statement": "."},
            "gap": gap,
            "effects": [{"name": name, "probability": 0.001} for name in EFFECT_NAMES],
            "where": {
                "points": [1 / count] * count,
                "frames": [1 / frames] * frames,
                "acts_on": [0.0] * count,
            },
            "sources": dict.fromkeys(("perception", "actuation", "parameters", "physics"), 0.25)
            | {"unexplained": 0.0},
        }
    )
    places, error = np.zeros((frames, count, 3)), np.zeros(frames)
    return Diagnosis(
        Findings(report, observation.times, places, places, error, error, places[0], observation.controllers)
    )


@pytest.mark.filterwarnings("ignore:beam.npz")
def test_the_report_has_all_frames_of_the_file(beam, tmp_path, monkeypatch):
    monkeypatch.setattr("model.gap.diagnose.diagnose", healthy)
    monkeypatch.setattr("model.gap.report.write.ALL_DRAWINGS", ())
    monkeypatch.setattr("model.gap.report.write.page", lambda report, images: "")
    path, seen = beam(0.3)
    result = diagnose(path, None, None, lambda stage, share: None)
    result.write_report(tmp_path)
    written = json.loads((tmp_path / "report.json").read_text())
    for frames in (result.report.where.frames, written["where"]["frames"]):
        assert len(frames) == len(seen.times)
        assert not any(frames[:29])
        assert sum(frames) == pytest.approx(1.0)
    assert any("lets it go" in line for line in written["warnings"])


@pytest.mark.parametrize("held", [0.0, 0.3])
def test_frames_in_which_something_unseen_holds_the_object_are_left_out(beam, monkeypatch, held):
    """No twin rests where something holds the object that it does not know of."""
    path, seen = beam(held)
    taken = []

    def ask(observation, twin, transfer, progress):
        taken.append(observation)
        raise Asked

    monkeypatch.setattr("model.gap.diagnose.diagnose", ask)
    with pytest.raises(Asked):
        diagnose(path, None, None, lambda stage, share: None)
    (asked,) = taken
    assert asked.times[0] == pytest.approx(held, abs=0.011)
    assert len(asked.points) == len(asked.controllers) == len(asked.times) < len(seen.times) + (held == 0.0)
