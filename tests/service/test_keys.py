import re

import pytest

from service.auth import ApiKeys
from service.main import main
from worker.embedded import EmbeddedRedis
from worker.queues import connect


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("MATPHYS_DATA_DIR", str(tmp_path))
    monkeypatch.delenv("REDIS_URL", raising=False)

    def run(*arguments: str) -> tuple[int, str, str]:
        code = main(["keys", *arguments])
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def test_keys_are_made_listed_and_revoked_while_the_service_rests(run, tmp_path):
    code, out, _ = run("create", "laptop", "--tenant", "lab", "--scope", "read")
    assert code == 0
    key = re.fullmatch(r"API key: (mp_([0-9a-f]+)_\S+)\n", out)
    assert key is not None
    code, out, _ = run("list")
    assert re.fullmatch(rf"{key[2]}  lab  read  laptop  \S+Z\n", out)
    with EmbeddedRedis(tmp_path / "redis") as server, connect(server.url) as client:
        assert ApiKeys(client).check(key[1]).tenant == "lab"
    assert run("revoke", key[2]) == (0, f"revoked {key[2]}\n", "")
    assert run("list") == (0, "", "")


def test_keys_are_made_while_the_service_runs(run, tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server, connect(server.url) as client:
        _, out, _ = run("create", "laptop")
        key = ApiKeys(client).check(out.removeprefix("API key: ").strip())
    assert key.scopes == ("submit", "read")
    assert key.tenant == "default"


def test_a_folder_named_before_the_command_is_meant(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("MATPHYS_DATA_DIR", str(tmp_path / "usual"))
    monkeypatch.delenv("REDIS_URL", raising=False)
    mine, other = str(tmp_path / "mine"), str(tmp_path / "other")
    assert main(["--data-dir", mine, "keys", "create", "laptop"]) == 0
    assert not (tmp_path / "usual").exists()
    capsys.readouterr()
    assert main(["--data-dir", other, "keys", "list", "--data-dir", mine]) == 0
    assert "laptop" in capsys.readouterr().out
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("arguments", [("list",), ("revoke", "000000000000")])
def test_a_folder_in_which_no_service_was_stays_as_it_is(run, tmp_path, arguments):
    code, _, err = run(*arguments, "--data-dir", str(tmp_path / "mistyped"))
    assert code == 2
    assert "no service has run here" in err
    assert not (tmp_path / "mistyped").exists()


def test_keys_of_a_service_elsewhere(run, redis_url, monkeypatch):
    monkeypatch.setenv("REDIS_URL", redis_url)
    _, out, _ = run("create", "laptop")
    with connect(redis_url) as client:
        assert ApiKeys(client).check(out.removeprefix("API key: ").strip()) is not None


@pytest.mark.parametrize(
    ("address", "words"),
    [("localhost:6379", "expected redis://HOST:PORT"), ("redis://127.0.0.1:1", "Redis does not answer")],
)
def test_an_address_without_a_redis_is_one_line(run, monkeypatch, address, words):
    monkeypatch.setenv("REDIS_URL", address)
    code, _, err = run("list")
    assert code == 2
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("create", "a b"), "name 'a b'"),
        (("create", "a", "--tenant", "x:y"), "tenant 'x:y'"),
        (("create", "a", "--scope", "root"), "root"),
        (("create",), "NAME"),
    ],
)
def test_what_makes_no_sense_is_one_line(run, arguments, words):
    code, _, err = run(*arguments)
    assert code == 2
    assert words in err
    assert err.count("\n") == 1


def test_a_key_that_is_not_there_cannot_be_revoked(run):
    assert run("create", "laptop")[0] == 0
    code, _, err = run("revoke", "000000000000")
    assert code == 2
    assert "there is no key 000000000000" in err
