import json
import re
import sys
from types import ModuleType

import pytest
from click.testing import CliRunner

from model.errors import InputError
from model.formats.page import EARLIER, END, START
from model.gap.benchmark.command import gap_benchmark
from model.gap.benchmark.labels import LOG, PLAIN, SEALED, seal

KEPT = "### What it shows\n\nwords\n\n## Others\n\n### More\n\nwords\n"
"""By hand, below a section."""


@pytest.fixture
def diagnose(monkeypatch, diagnosis_of, report_of):
    """In the place of the real one, which takes minutes."""
    module = ModuleType("model.gap.diagnose")
    module.diagnose = lambda observation, twin=None, *, transfer=None, progress=None: diagnosis_of(
        report_of("none" if transfer is None else "wind")
    )
    monkeypatch.setitem(sys.modules, "model.gap.diagnose", module)


def call(*options):
    done = CliRunner().invoke(gap_benchmark, [str(option) for option in options], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done


def test_one_command_prints_the_table_and_writes_the_page(worlds, tmp_path, diagnose):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    marks = [mark.format("gap-benchmark", "Three worlds") for mark in (START, END)]
    page.write_text("\n\n".join(["# Head", marks[0], "## Three worlds", "formerly", marks[1], KEPT]))
    options = ("--out", tmp_path / "out", "--workers", 1, "--docs", page, "--title", "Three worlds")
    printed = call(worlds, *options).output
    assert re.search(r"top-1 +1\.000 \[0\.207, 1\.000\] +≥ 0\.75 +holds", printed)
    text = page.read_text()
    heads = ["# Head", "## Three worlds", "### What it shows", "## Others", "### More"]
    assert re.findall("(?m)^#.*$", text) == heads
    assert "3 worlds of `worlds` (1 null, 2 single)" in text
    assert text.endswith(KEPT.replace("shows\n", f"shows\n\n{EARLIER}formerly*\n"))
    assert f"matphys gap-benchmark {worlds} --out {tmp_path / 'out'} --title 'Three worlds'" in text
    images = re.findall(r"\((images/[^)]+)\)", text)
    assert len(images) == 3
    assert all((page.parent / image).read_bytes().startswith(b"\x89PNG") for image in images)


def test_sealed_labels_are_opened_after_the_predictions_are_hashed(worlds, tmp_path, diagnose):
    text = (worlds / PLAIN).read_bytes()
    (worlds / PLAIN).unlink()
    (worlds / SEALED).write_bytes(seal(text))
    printed = call(worlds, "--out", tmp_path / "out", "--workers", 1, "--json").stdout
    content = json.loads(printed)
    assert content["rows"][0]["score"]["value"] == 1.0
    (entry,) = json.loads((worlds / LOG).read_text())
    assert entry["predictions"] == content["run"]["digest"]


def test_nothing_is_printed_where_nothing_is_wanted(worlds, tmp_path, diagnose):
    assert call(worlds, "--out", tmp_path / "out", "--workers", 1, "--quiet").output == ""


def test_a_folder_without_labels_is_refused_before_any_work(worlds, tmp_path, diagnose):
    (worlds / PLAIN).unlink()
    with pytest.raises(InputError, match=r"expected labels\.json or labels\.sealed"):
        call(worlds, "--out", tmp_path / "out", "--workers", 1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("out", "page", "said"),
    [
        ("file/out", "page.md", "file is not a folder"),
        ("out", "file/page.md", "file is not a folder"),
        ("out", "broken.md", "once each, in this order"),
    ],
)
def test_what_cannot_be_written_is_refused_before_any_work(worlds, tmp_path, diagnose, out, page, said):
    """Not after hours, once the labels have been opened."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "broken.md").write_text(START.format("gap-benchmark", "Worlds"))
    text = (worlds / PLAIN).read_bytes()
    (worlds / PLAIN).unlink()
    (worlds / SEALED).write_bytes(seal(text))
    with pytest.raises(InputError, match=said):
        call(worlds, "--out", tmp_path / out, "--workers", 1, "--docs", tmp_path / page)
    assert not (tmp_path / "out").exists()
    assert not (worlds / LOG).exists()


def test_labels_stay_closed_where_diagnoses_break(worlds, tmp_path, monkeypatch):
    def broken(observation, twin=None, *, transfer=None, progress=None):
        raise FileNotFoundError("no weights")

    monkeypatch.setitem(sys.modules, "model.gap.diagnose", ModuleType("model.gap.diagnose"))
    monkeypatch.setattr(sys.modules["model.gap.diagnose"], "diagnose", broken, raising=False)
    text = (worlds / PLAIN).read_bytes()
    (worlds / PLAIN).unlink()
    (worlds / SEALED).write_bytes(seal(text))
    with pytest.raises(RuntimeError, match=r"3 of 3 diagnoses broke, labels stay closed; .*no weights"):
        call(worlds, "--out", tmp_path / "out", "--workers", 1)
    assert not (worlds / LOG).exists()


def test_a_page_can_be_of_worlds_none_of_which_is_clear(worlds, tmp_path, diagnose):
    for name in ("quiet", "blown"):
        for path in worlds.glob(f"{name}*"):
            path.unlink()
    labels = [each for each in json.loads((worlds / PLAIN).read_text()) if each["world"] == "odd"]
    (worlds / PLAIN).write_text(json.dumps(labels))
    page = tmp_path / "page.md"
    call(worlds, "--out", tmp_path / "out", "--workers", 1, "--docs", page, "--quiet")
    text = page.read_text()
    assert text.startswith("# The withheld check\n")
    assert text.count(".png)") == 1
