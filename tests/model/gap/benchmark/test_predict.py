import json
from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.gap.benchmark.predict import PREDICTIONS, digest, predict, read_predictions

STAND_IN = """
import sys
sys.path.insert(0, {tests!r})
from conftest import diagnosis_of, report_of

def diagnose(observation, twin=None, *, transfer=None, progress=None):
    return diagnosis_of(report_of("none" if transfer is None else "wind"))
"""


class Counting:
    """Says `wind` where there is a transfer, `none` otherwise, and breaks on the world called odd."""

    def __init__(self, diagnosis_of, report_of, odd):
        self.called, self.odd = 0, odd
        self._make = lambda answer: diagnosis_of(report_of(answer))

    def __call__(self, observation, twin=None, *, transfer=None, progress=None):
        self.called += 1
        if len(observation.times) and float(observation.points[0, 0, 0]) == self.odd:
            raise ZeroDivisionError("no such number")
        return self._make("none" if transfer is None else "wind")


@pytest.fixture
def diagnose(worlds, diagnosis_of, report_of):
    points = np.load(worlds / "odd.npz")["points"]
    return Counting(diagnosis_of, report_of, float(points[0, 0, 0]))


def test_worlds_are_diagnosed_once_and_written_down(worlds, tmp_path, diagnose):
    out, shares = tmp_path / "out", []
    said = predict(worlds, out, diagnose, 1, lambda stage, share: shares.append((stage, share)))
    assert {name: each.report and each.report.verdict.effect for name, each in said.items()} == {
        "blown": "wind",
        "odd": None,
        "quiet": "none",
    }
    assert said["odd"].refused == "ZeroDivisionError: no such number"
    assert shares[-1] == ("3 of 3 worlds", 1.0)
    first = digest(out / PREDICTIONS)
    assert {name: (e.report, e.refused) for name, e in read_predictions(out / PREDICTIONS).items()} == {
        name: (e.report, e.refused) for name, e in said.items()
    }
    again = predict(worlds, out, diagnose, 1)
    assert diagnose.called == 4, "only the one that broke is tried again"
    assert again["blown"].seconds == said["blown"].seconds
    assert digest(out / PREDICTIONS) == first


def test_a_world_that_changed_is_diagnosed_anew(worlds, tmp_path, diagnose):
    predict(worlds, tmp_path / "out", diagnose, 1)
    (worlds / "blown.transfer.npz").unlink()
    assert predict(worlds, tmp_path / "out", diagnose, 1)["blown"].report.verdict.effect == "none"


def test_what_another_version_said_is_not_taken_for_what_this_one_says(
    worlds, tmp_path, diagnose, monkeypatch
):
    predict(worlds, tmp_path / "out", diagnose, 1)
    called = diagnose.called
    monkeypatch.setattr("model.gap.benchmark.predict.__version__", "9.9.9")
    predict(worlds, tmp_path / "out", diagnose, 1)
    assert diagnose.called == called + 3


def test_a_refusal_is_an_answer(worlds, tmp_path):
    def refuse(observation, twin=None, *, transfer=None, progress=None):
        raise InputError("points: nothing moves")

    assert predict(worlds, tmp_path / "out", refuse, 1)["quiet"].refused == "points: nothing moves"
    kept = json.loads((tmp_path / "out" / "diagnoses" / "quiet.json").read_text())
    assert not kept["broke"]


def test_no_worlds(tmp_path, diagnose):
    with pytest.raises(InputError, match=r"expected worlds NAME\.npz, found none"):
        predict(tmp_path, tmp_path / "out", diagnose, 1)


def test_other_processes_say_the_same(worlds, tmp_path, monkeypatch):
    (tmp_path / "standing_in.py").write_text(STAND_IN.format(tests=str(Path(__file__).parent)))
    monkeypatch.syspath_prepend(tmp_path)
    import standing_in

    said = predict(worlds, tmp_path / "out", standing_in.diagnose, 2)
    assert [each.report.verdict.effect for each in said.values()] == ["wind", "wind", "none"]
