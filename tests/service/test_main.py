"""`matphys-serve` as a process: what it prints, what it starts, what it leaves."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

HEAVY = ("torch", "cv2", "scipy", "trimesh")


class Process:
    """A running `matphys-serve`."""

    def __init__(self, popen: subprocess.Popen[str]) -> None:
        self.popen = popen
        self.key, self.address = None, ""
        assert popen.stdout is not None
        for line in popen.stdout:
            if found := re.fullmatch(r"API key: (mp_\S+)\n", line):
                assert self.key is None
                self.key = found[1]
            if found := re.fullmatch(r"MatPhys is at (http://\S+)\n", line):
                self.address = found[1]
                return
        raise AssertionError(popen.stderr.read() if popen.stderr else "")

    def children(self) -> dict[int, str]:
        """Every process below it: id → command."""
        found = {}
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
                command = (path.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:
                continue
            if int(fields[1]) in (self.popen.pid, *found):
                found[int(path.parent.name)] = command
        return found

    def child(self, command: str, apart_from: int = 0, seconds: float = 20.0) -> int:
        """The id of the child that runs a command, once there is one."""
        for _ in range(round(seconds / 0.05)):
            for pid, line in self.children().items():
                if command in line and pid != apart_from:
                    return pid
            time.sleep(0.05)
        raise AssertionError(f"no {command} among {self.children()}")

    def stop(self) -> int:
        self.popen.terminate()
        return self.popen.wait(30)


@pytest.fixture
def start(tmp_path) -> Iterator:
    """Starts `matphys-serve` over `tmp_path`; what still runs at the end is killed."""
    started = []

    def start(*arguments: str, **environment: str) -> Process:
        popen = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "service.main",
                "--port",
                "0",
                "--data-dir",
                str(tmp_path / "data"),
                *arguments,
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={name: value for name, value in os.environ.items() if not name.endswith("_URL")}
            | environment,
        )
        started.append(popen)
        return Process(popen)

    yield start
    for popen in started:
        popen.kill()
        popen.wait()
        popen.stdout.close()


def ends(pids, seconds: float = 15.0) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        alive = [pid for pid in pids if _alive(pid)]
        if not alive:
            return True
        time.sleep(0.05)
    return False


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def refused(*arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "service.main", *arguments],
        capture_output=True,
        text=True,
        env=os.environ | environment,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    return done.stderr


def test_the_first_start_prints_a_key_and_a_later_one_does_not(start):
    first = start()
    assert first.key is not None
    headers = {"Authorization": f"Bearer {first.key}"}
    assert httpx.get(f"{first.address}/twins", headers=headers).status_code == 200
    children = first.children()
    assert any("redis-server" in command for command in children.values())
    assert first.stop() == 0
    assert ends(children)
    second = start()
    assert second.key is None
    assert httpx.get(f"{second.address}/twins", headers=headers).status_code == 200


def test_a_stop_ends_streams_and_leaves_no_process(start, clip):
    process = start()
    headers = {"Authorization": f"Bearer {process.key}"}
    twin = httpx.post(f"{process.address}/twins", content=clip, headers=headers, timeout=30).json()
    children = {process.child("redis-server"), process.child("worker.main")}
    with httpx.stream(
        "GET", f"{process.address}/twins/{twin['id']}/events", headers=headers, timeout=30
    ) as answer:
        lines = answer.iter_lines()
        next(lines)
        started = time.monotonic()
        process.popen.send_signal(signal.SIGINT)
        for _ in lines:
            pass
    assert process.popen.wait(40) == 0
    assert time.monotonic() - started < 40
    assert ends(children | set(process.children()))


def test_a_killed_front_takes_its_children_along_and_the_next_has_the_jobs(start, clip):
    process = start()
    headers = {"Authorization": f"Bearer {process.key}"}
    twin = httpx.post(f"{process.address}/twins", content=clip, headers=headers, timeout=30).json()
    children = {process.child("redis-server"), process.child("worker.main")}
    process.popen.kill()
    assert ends(children)
    again = start()
    assert (
        httpx.get(f"{again.address}/twins/{twin['id']}", headers=headers).json()["options"] == twin["options"]
    )


def test_children_that_are_killed_are_started_again(start):
    process = start()
    for command in ("redis-server", "worker.main"):
        before = process.child(command)
        os.kill(before, signal.SIGKILL)
        assert process.child(command, apart_from=before) != before
    for _ in range(100):
        answer = httpx.get(f"{process.address}/twins", headers={"Authorization": f"Bearer {process.key}"})
        if answer.status_code == 200:
            break
        assert answer.status_code == 503
    assert answer.status_code == 200


def test_a_folder_may_be_named_from_where_one_is(start, redis_url, clip, tmp_path, monkeypatch):
    (tmp_path / "with space%20").mkdir()
    monkeypatch.chdir(tmp_path / "with space%20")
    process = start("--data-dir", "data", REDIS_URL=redis_url)
    headers = {"Authorization": f"Bearer {process.key}"}
    assert (
        httpx.post(f"{process.address}/twins", content=clip, headers=headers, timeout=30).status_code == 202
    )
    assert list((tmp_path / "with space%20" / "data" / "store").rglob("video.mp4"))


def test_a_front_of_many_starts_no_child_and_is_light(start, redis_url):
    process = start(REDIS_URL=redis_url)
    assert process.key is not None
    assert httpx.get(f"{process.address}/readyz").json()["checks"]["redis"] == "ok"
    assert process.children() == {}
    status = Path(f"/proc/{process.popen.pid}/status").read_text()
    assert int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) < 200_000
    maps = Path(f"/proc/{process.popen.pid}/maps").read_text()
    assert not any(f"/{name}/" in maps for name in HEAVY)
    assert process.stop() == 0


def test_the_service_imports_nothing_heavy():
    code = f"import sys, service.main; sys.exit(', '.join({set(HEAVY)!r} & set(sys.modules)) or None)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_two_over_one_folder_are_refused(start, tmp_path):
    start()
    line = refused("--port", "0", "--data-dir", str(tmp_path / "data"), REDIS_URL="")
    assert "in use by another matphys-serve" in line


def test_a_port_that_is_taken_is_refused(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        line = refused("--port", str(taken.getsockname()[1]), "--data-dir", str(tmp_path))
    assert "choose another --host or --port" in line


@pytest.mark.parametrize(
    ("arguments", "environment", "words"),
    [
        (["--port", "99999"], {}, "99999"),
        (["--host", "not a host"], {}, "not a host"),
        (["--surprise"], {}, "--surprise"),
        ([], {"MATPHYS_MAX_JOBS": "many"}, "MATPHYS_MAX_JOBS=many"),
        ([], {"MATPHYS_LOG_LEVEL": "loud"}, "MATPHYS_LOG_LEVEL=LOUD"),
        ([], {"REDIS_URL": "redis://127.0.0.1:1", "STORE_URL": "ftp://x"}, "ftp://x"),
        ([], {"REDIS_URL": "localhost:6379"}, "expected redis://HOST:PORT"),
    ],
)
def test_a_wrong_setting_is_named_in_one_line(tmp_path, arguments, environment, words):
    assert words in refused("--data-dir", str(tmp_path), "--port", "0", *arguments, **environment)


def test_a_folder_that_cannot_be_is_refused_in_one_line(redis_url):
    line = refused(
        "--data-dir", "/proc/nope/x", "--port", "0", REDIS_URL=redis_url, STORE_URL="file:///tmp/x"
    )
    assert "/proc/nope/x: cannot keep data there" in line


def test_answers_are_not_held_back():
    from service.main import _listen

    with _listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0
