"""A folder has all of a report or none of it."""

import io
import json
import os

import pytest
from PIL import Image

from model.errors import InputError
from model.gap.report import write
from model.gap.report.figures import ALL_DRAWINGS
from model.gap.report.write import write_report
from model.gap.schema import GapReport
from model.schema import read_json

NAMES = {"report.json", "report.html", *(each.file for each in ALL_DRAWINGS)}


@pytest.fixture
def unpainted(monkeypatch):
    """Figures are laid out but not painted, which takes most of the time."""
    image = Image.new("L", (2, 2))
    buffer = io.BytesIO()
    image.save(buffer, "png")
    monkeypatch.setattr(write, "png", lambda figure: buffer.getvalue())


def there(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_all_files_are_there_and_read_back(findings, tmp_path):
    written = write_report(findings, tmp_path / "a" / "report")
    folder = tmp_path / "a" / "report"
    assert written[0] == folder / "report.json"
    assert {path.name for path in written} == NAMES == set(there(folder))
    report = read_json((folder / "report.json").read_bytes(), GapReport, "report.json")
    assert report.verdict.statement.startswith("Wind is missing")
    assert report.gap == findings.report.gap
    assert (
        report.verdict.statement in json.loads((folder / "report.json").read_text())["verdict"]["statement"]
    )


def test_equal_findings_give_equal_files_and_others_stay(findings, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    write_report(findings, tmp_path)
    first = there(tmp_path)
    write_report(findings, tmp_path)
    assert there(tmp_path) == first
    assert first["notes.txt"] == b"mine"


@pytest.mark.usefixtures("unpainted")
def test_a_page_that_fails_leaves_the_old_report(findings, nothing, tmp_path, monkeypatch):
    write_report(findings, tmp_path)
    first = there(tmp_path)

    def fail(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(write, "page", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        write_report(nothing, tmp_path)
    assert there(tmp_path) == first


@pytest.mark.usefixtures("unpainted")
def test_a_full_disk_leaves_the_old_report(findings, nothing, tmp_path, monkeypatch):
    write_report(findings, tmp_path)
    first = there(tmp_path)
    real = write.Path.write_bytes

    def full(path, content):
        if path.suffix == ".png":
            raise OSError(28, "No space left on device")
        return real(path, content)

    monkeypatch.setattr(write.Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        write_report(nothing, tmp_path)
    assert there(tmp_path) == first


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("after", [0, 3, 6])
def test_a_report_that_breaks_off_is_not_taken_for_one(findings, nothing, tmp_path, monkeypatch, after):
    write_report(findings, tmp_path)
    real, count = os.replace, iter(range(100))

    def breaks(source, target):
        if next(count) >= after:
            raise OSError(5, "Input/output error")
        real(source, target)

    monkeypatch.setattr(os, "replace", breaks)
    with pytest.raises(OSError, match="Input/output"):
        write_report(nothing, tmp_path)
    assert not (tmp_path / "report.json").exists()
    assert {name for name in there(tmp_path) if name.startswith(".")} == set()


@pytest.mark.usefixtures("unpainted")
def test_a_file_in_place_of_the_folder_is_refused(findings, tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="is not a folder"):
        write_report(findings, tmp_path / "out")
