import os
from pathlib import Path

import pytest

from model.errors import InputError
from model.formats.files import check_writable, replacing


def test_replaces_at_the_end(tmp_path: Path):
    path = tmp_path / "new" / "x.mp4"
    with replacing(path) as temporary:
        assert temporary.suffix == ".mp4"
        assert temporary.parent == path.parent
        temporary.write_bytes(b"one")
        assert not path.exists()
    assert path.read_bytes() == b"one"
    assert list(path.parent.iterdir()) == [path]


def test_a_failure_changes_nothing(tmp_path: Path):
    path = tmp_path / "x.mp4"
    path.write_bytes(b"old")

    def write_half() -> None:
        with replacing(path) as temporary:
            temporary.write_bytes(b"half")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        write_half()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_reader_of_the_old_file_keeps_it(tmp_path: Path):
    path = tmp_path / "x.mp4"
    path.write_bytes(b"old")
    with replacing(path) as temporary:
        temporary.write_bytes(b"new")
    os.link(path, tmp_path / "link")
    with replacing(path) as temporary:
        temporary.write_bytes(b"newer")
    assert (tmp_path / "link").read_bytes() == b"new"
    assert path.read_bytes() == b"newer"


def test_a_long_name(tmp_path: Path):
    path = tmp_path / ("x" * 240 + ".twin.zip")
    with replacing(path) as temporary:
        temporary.write_bytes(b"one")
    assert path.exists()


def test_what_cannot_be_a_file(tmp_path: Path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file" / "x", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match="cannot write"), replacing(path):
            pass
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="a device or a pipe"):
        check_writable(tmp_path / "pipe")
    (tmp_path / "lost").symlink_to(tmp_path / "gone")
    for path in (tmp_path / "lost", tmp_path / "lost" / "report.json"):
        with pytest.raises(InputError, match="lost is a link that leads nowhere"):
            check_writable(path)
    check_writable(tmp_path / "not" / "yet" / "there")
    assert not (tmp_path / "not").exists()
