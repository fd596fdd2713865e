import sys

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
