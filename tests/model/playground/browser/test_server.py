import socket

import pytest

from model.cli import main
from model.errors import InputError
from model.playground.browser.server import open_playground


@pytest.fixture
def taken_port():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def refused(capsys, *arguments):
    assert main(["view", *map(str, arguments)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_a_taken_port_is_said_in_one_line(twin_path, taken_port, capsys):
    line = refused(capsys, twin_path, "--port", taken_port)
    assert f"127.0.0.1:{taken_port}: cannot listen" in line
    assert "--port" in line


def test_a_broken_bundle_is_said_in_one_line(write_twin, capsys):
    path = write_twin(files={"twin.json": b"nonsense"})
    assert "twin.json" in refused(capsys, path)


def test_without_viser_the_command_that_installs_it_is_said(twin_path, monkeypatch, capsys):
    import importlib.util

    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "viser" else find(name, *rest)
    )
    assert "pip install 'viser>=1.1'" in refused(capsys, twin_path)


def test_nothing_to_compare_is_said_in_one_line(twin_path, capsys):
    assert "carries no effect" in refused(capsys, twin_path, "--compare")


def test_an_observation_without_a_report_says_nothing(twin_path, tmp_path):
    with pytest.raises(InputError, match="--observation: only with --report"):
        open_playground(twin_path, observation=tmp_path / "seen.npz")


def test_an_address_that_is_none_is_refused(twin_path):
    with pytest.raises(InputError, match="cannot listen"):
        open_playground(twin_path, host="203.0.113.7", port=8080)
