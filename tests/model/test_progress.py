import sys
import time

import pytest

from model.progress import progress


def work(quiet: bool = False) -> None:
    with progress(quiet) as report:
        for stage, share in [("first", 0.0), ("first", 0.2), ("second", 0.5), ("done", 1.0)]:
            report(stage, share)


def test_lines_once_a_stage(capsys: pytest.CaptureFixture[str]):
    work()
    captured = capsys.readouterr()
    assert captured.out == ""
    assert [line.split()[-2:] for line in captured.err.splitlines()] == [
        ["0%", "first"],
        ["50%", "second"],
        ["100%", "done"],
    ]


def test_quiet(capsys: pytest.CaptureFixture[str]):
    work(quiet=True)
    assert capsys.readouterr() == ("", "")


def test_a_bar_on_a_terminal(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    work()
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "100%" in captured.err
    assert "\x1b[" in captured.err


def test_a_long_stage_is_heard_of_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    clock = iter([0.0, 1.0, 5.0, 26.0, 30.0, 31.0])
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    with progress(quiet=False) as report:
        for stage, share in [("cases", 0.0), ("cases", 0.1), ("cases", 0.5), ("cases", 0.6), ("motion", 0.7)]:
            report(stage, share)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[2:] for line in lines] == [["0%", "cases"], ["50%", "cases"], ["70%", "motion"]]
