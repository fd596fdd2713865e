import zipfile
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from model.errors import InputError
from model.exports import ALL_EXPORTERS
from worker.kinds.export import FORMATS, ExportKind, ExportOptions
from worker.record import JobRecord


def test_every_exporter_can_be_asked_for():
    assert set(FORMATS) == {exporter.name for exporter in ALL_EXPORTERS}


def test_other_formats_are_refused():
    with pytest.raises(ValidationError, match="unknown format: choose one of ply"):
        ExportOptions(format="exe")


class Writing:
    """An exporter that writes as it is told and loses one effect."""

    def __init__(self, write):
        self.write = write

    def __call__(self, twin, out):
        self.write(twin, out)

    def losses(self, twin):
        return (f"no wind in it: {twin}",)


def make_run(tmp_path, write, parent):
    logged = []
    modules = {
        "bundle": SimpleNamespace(TwinBundle=SimpleNamespace(load=lambda path: f"twin from {path.name}")),
        "registry": SimpleNamespace(by_name=lambda methods, name, stage: lambda: Writing(write)),
        "exports": SimpleNamespace(ALL_EXPORTERS=()),
    }
    return SimpleNamespace(
        parent=parent,
        record=JobRecord(id="2", kind="export", queue="exports", tenant="a", options={"format": "ply"}),
        folder=tmp_path,
        log=logged.append,
        logged=logged,
        report=lambda stage, share: None,
        model=modules.__getitem__,
        fetch=lambda record, name: tmp_path / name,
    )


@pytest.fixture
def parent():
    return JobRecord(id="1", kind="twin", queue="twins", tenant="a")


def test_a_file_is_published_as_it_is(tmp_path, parent):
    run = make_run(tmp_path, lambda twin, out: out.write_text(twin), parent)
    (path,) = ExportKind().run(run).files
    assert (path.name, path.read_text()) == ("twin.ply", "twin from bundle.twin.zip")


def test_the_effects_that_a_format_lacks_are_in_the_log(tmp_path, parent):
    run = make_run(tmp_path, lambda twin, out: out.write_text(twin), parent)
    ExportKind().run(run)
    assert run.logged == ["warning: no wind in it: twin from bundle.twin.zip"]


def test_a_folder_is_published_as_one_archive(tmp_path, parent):
    def write(twin, out):
        (out / "meshes").mkdir(parents=True)
        (out / "twin.xml").write_text(twin)

    (path,) = ExportKind().run(make_run(tmp_path, write, parent)).files
    assert path.name == "twin.ply.zip"
    with zipfile.ZipFile(path) as archive:
        assert archive.read("twin.xml") == b"twin from bundle.twin.zip"


def test_without_its_twin_there_is_no_export(tmp_path):
    with pytest.raises(InputError, match="the twin is gone"):
        ExportKind().run(make_run(tmp_path, None, None))
