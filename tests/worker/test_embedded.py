import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
import redis

from model.errors import InputError
from worker.embedded import EmbeddedRedis, find_redis_server, running_address


def get(url: str, key: str) -> bytes | None:
    with redis.Redis.from_url(url) as client:
        value: bytes | None = client.get(key)
        return value


def put(url: str, key: str, value: str) -> None:
    with redis.Redis.from_url(url) as client:
        client.set(key, value)


def test_only_this_user_reaches_it_and_only_through_the_socket(tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server, redis.Redis.from_url(server.url) as client:
        assert client.config_get("port") == {"port": "0"}
        assert client.config_get("appendonly") == {"appendonly": "yes"}
        folder = Path(server.url.removeprefix("unix://")).parent
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_folder_that_others_could_read_is_closed(tmp_path):
    (tmp_path / "redis").mkdir(mode=0o777)
    with EmbeddedRedis(tmp_path / "redis"):
        assert stat.S_IMODE((tmp_path / "redis").stat().st_mode) == 0o700


def test_the_data_outlive_a_stop(tmp_path):
    with EmbeddedRedis(tmp_path) as server:
        put(server.url, "job", "accepted")
    with EmbeddedRedis(tmp_path) as server:
        assert get(server.url, "job") == b"accepted"


def test_a_killed_server_comes_back_at_the_same_address_with_what_it_acknowledged(tmp_path):
    with EmbeddedRedis(tmp_path) as server:
        address = server.url
        put(address, "job", "accepted")
        assert server.pid is not None
        os.kill(server.pid, signal.SIGKILL)
        while server.pid is not None:
            time.sleep(0.01)
        server.start()
        assert server.url == address
        assert get(address, "job") == b"accepted"


def test_starting_a_running_server_changes_nothing(tmp_path):
    with EmbeddedRedis(tmp_path) as server:
        before = server.pid
        server.start()
        assert server.pid == before


def test_stop_ends_the_process_and_frees_the_folder(tmp_path, eventually, living):
    server = EmbeddedRedis(tmp_path)
    server.start()
    pid = server.pid
    assert pid is not None
    server.stop()
    server.stop()
    eventually(lambda: not living(pid=pid), 5.0)
    with EmbeddedRedis(tmp_path) as other:
        assert other.pid is not None


def test_a_second_start_over_the_same_folder_is_refused_with_one_line(tmp_path):
    with EmbeddedRedis(tmp_path) as server:
        put(server.url, "job", "accepted")
        with pytest.raises(InputError, match="in use by another matphys-serve") as refusal:
            EmbeddedRedis(tmp_path).start()
        assert "\n" not in str(refusal.value)
        assert get(server.url, "job") == b"accepted"


def test_a_killed_owner_takes_the_server_along_and_the_next_start_finds_the_data(
    tmp_path, eventually, living
):
    code = (
        "import sys, time, redis; from pathlib import Path; from worker.embedded import EmbeddedRedis\n"
        "server = EmbeddedRedis(Path(sys.argv[1])); server.start()\n"
        "redis.Redis.from_url(server.url).set('job', 'accepted')\n"
        "print(server.pid, flush=True); time.sleep(60)"
    )
    owner = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    with owner.stdout:
        pid = int(owner.stdout.readline())
    owner.kill()
    owner.wait()
    with EmbeddedRedis(tmp_path) as server:  # at once: it waits for the orphan to end
        eventually(lambda: not living(pid=pid), 5.0)
        assert get(server.url, "job") == b"accepted"


def test_a_path_too_long_for_a_socket_is_no_obstacle(tmp_path):
    deep = tmp_path / ("x" * 120)
    with EmbeddedRedis(deep) as server:
        put(server.url, "job", "accepted")
        sockets = Path(server.url.removeprefix("unix://")).parent
        assert stat.S_IMODE(sockets.stat().st_mode) == 0o700
    assert not sockets.exists()
    with EmbeddedRedis(deep) as server:
        assert get(server.url, "job") == b"accepted"


def test_a_folder_may_have_any_name(tmp_path):
    with EmbeddedRedis(tmp_path / "a b%20#?é") as server:
        put(server.url, "job", "accepted")
        assert get(running_address(tmp_path / "a b%20#?é"), "job") == b"accepted"
    with EmbeddedRedis(tmp_path / "a b%20#?é") as server:
        assert get(server.url, "job") == b"accepted"


def test_others_find_a_server_that_runs_and_none_that_does_not(tmp_path):
    assert running_address(tmp_path) is None
    assert running_address(tmp_path / "nothing") is None
    with EmbeddedRedis(tmp_path / ("x" * 120)) as server:
        assert running_address(tmp_path / ("x" * 120)) == server.url
    assert running_address(tmp_path / ("x" * 120)) is None


def test_a_launch_does_not_wait(tmp_path):
    server = EmbeddedRedis(tmp_path)
    server.launch()
    assert server.pid is not None
    server.start()
    assert get(server.url, "job") is None
    server.stop()


def test_damaged_data_are_refused_with_one_line_and_nothing_keeps_running(tmp_path):
    (tmp_path / "appendonly.aof").write_bytes(b"*3\r\n$3\r\nSET\r\nno length\r\n" + b"x" * 64)
    server = EmbeddedRedis(tmp_path)
    with pytest.raises(InputError, match=r"see redis\.log"):
        server.start()
    assert server.pid is None
    (tmp_path / "appendonly.aof").unlink()
    server.start()
    server.stop()


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "redis").write_text("")
    with pytest.raises(InputError, match="cannot keep data there"):
        EmbeddedRedis(tmp_path / "redis").start()


def test_the_server_of_the_machine_goes_before_the_packaged_one(tmp_path, monkeypatch):
    packaged = find_redis_server()
    own = tmp_path / "redis-server"
    own.symlink_to(packaged)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_redis_server() == own


def test_a_machine_without_redis_is_told_what_to_do(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match="REDIS_URL"):
        find_redis_server()
