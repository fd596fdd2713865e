"""What the command says of ropes: errors of frames, a row, a figure, absent data."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.gap import ropes
from model.gap.report.style import png
from model.gap.schema import GapReport


def found(effect, with_effect):
    """Of a rope whose error grows to 10, 20 and 30 mm within 5 s."""
    times = np.linspace(0.0, 5.0, 501)
    names = list(ropes.LOOKS)[: 2 if with_effect is None else 3]
    errors = {name: (1 + i) * 0.01 * times / 5.0 for i, name in enumerate(names)}
    closed = None if with_effect is None else 0.5
    there = SimpleNamespace(refit=0.03, with_effect=with_effect, closed_fraction=closed)
    report = GapReport.model_construct(
        gap=SimpleNamespace(refit=0.02, with_effect=with_effect, closed_fraction=closed, transfer=there),
        verdict=SimpleNamespace(effect=effect, probability=0.4),
        where=SimpleNamespace(acts_on=(0.0, 0.0) if with_effect is None else (0.2, 1.0)),
    )
    return ropes.Found("DLO9", report, 12.0, times, errors)


def test_a_row_has_means_over_the_clip_and_dashes_where_there_is_nothing():
    one, none = found("bending_stiffness", 0.01), found("none", None)
    assert str(one).split(" | ")[3:7] == ["0.2, 1.0", "20.0", "10.0", "0.50"]
    assert str(one).split(" | ")[10:13] == ["5.0", "10.0", "15.0"]
    assert str(none).split(" | ")[3:7] == ["–", "20.0", "–", "–"]
    assert str(none).split(" | ")[10:13] == ["5.0", "10.0", "–"]


def test_every_rope_has_its_panel():
    figure = ropes.drawn([found("bending_stiffness", 0.01), found("none", None)])
    drawn = [[line.get_label() for line in axes.get_lines()] for axes in figure.axes]
    assert drawn == [list(ropes.LOOKS), list(ropes.LOOKS)[:2]]
    assert figure.axes[0].get_lines()[1].get_ydata()[-1] == pytest.approx(20.0)
    assert png(figure).startswith(b"\x89PNG")


def test_errors_of_frames_leave_out_what_is_not_seen():
    away = np.zeros((2, 3, 3), np.float32)
    away[1] = [[0.01, -0.02, 0.03], [np.nan, np.nan, np.nan], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(ropes.of_frames(away), [0.0, 0.01], atol=1e-9)


def test_absent_data_are_said_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MATPHYS_DATA", str(tmp_path))
    assert ropes.main(["--out", str(tmp_path / "out")]) == 2
    assert "MATPHYS_DATA" in capsys.readouterr().err
