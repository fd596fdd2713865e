import asyncio
import os

import pytest

from service import probe
from service.errors import ProblemError
from service.probe import Inspector


def inspect(parallel=1, **files):
    async def run():
        inspector = Inspector(parallel)
        return await inspector.inspect("a", files)

    return asyncio.run(run())


@pytest.fixture
def video(tmp_path, clip):
    path = tmp_path / "video"
    path.write_bytes(clip)
    return path


def test_it_says_which_suffix_suits(video):
    assert inspect(video=("video", video)) == {"video": ".mp4"}


def test_what_it_refuses_is_a_problem(tmp_path):
    (tmp_path / "x").write_bytes(b"#EXTM3U\n")
    with pytest.raises(ProblemError, match="video: no video") as error:
        inspect(video=("video", tmp_path / "x"))
    assert error.value.status == 415


def test_a_process_that_says_nothing_is_a_refusal(video, monkeypatch):
    monkeypatch.setattr(probe.sys, "executable", "/bin/false")
    with pytest.raises(ProblemError, match="cannot be read within the limits") as error:
        inspect(video=("video", video))
    assert error.value.status == 422


def test_a_process_that_does_not_end_is_ended(video, monkeypatch, tmp_path):
    endless = tmp_path / "endless"
    endless.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/pid\nexec sleep 60\n")
    endless.chmod(0o755)
    monkeypatch.setattr(probe.sys, "executable", str(endless))
    monkeypatch.setattr(probe, "WALL_SECONDS", 0.5)
    with pytest.raises(ProblemError, match="cannot be read"):
        inspect(video=("video", video))
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_it_knows_nothing_of_our_secrets(video, monkeypatch, tmp_path):
    spy = tmp_path / "spy"
    spy.write_text(f"#!/bin/sh\nenv > {tmp_path}/env\npwd >> {tmp_path}/env\n")
    spy.chmod(0o755)
    monkeypatch.setattr(probe.sys, "executable", str(spy))
    monkeypatch.setenv("REDIS_URL", "redis://:s3cret@host")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "s3cret")
    with pytest.raises(ProblemError):
        inspect(video=("video", video))
    assert "s3cret" not in (tmp_path / "env").read_text()


def test_only_so_many_look_at_the_same_time(video, monkeypatch):
    running, most = 0, 0

    async def look(request):
        nonlocal running, most
        running += 1
        most = max(most, running)
        await asyncio.sleep(0.01)
        running -= 1
        return b'{"suffixes": {}}'

    async def run():
        inspector = Inspector(2)
        await asyncio.gather(*(inspector.inspect(str(i), {"video": ("video", video)}) for i in range(8)))

    monkeypatch.setattr(probe, "_run", look)
    asyncio.run(run())
    assert most == 2


def test_who_sends_more_than_can_be_looked_into_is_told_so(video, monkeypatch):
    monkeypatch.setattr(probe, "WAIT_SECONDS", 0.01)

    async def run():
        inspector = Inspector(1)
        files = {"video": ("video", video)}
        return await asyncio.gather(
            *(inspector.inspect("a", files) for _ in range(2)), return_exceptions=True
        )

    first, second = asyncio.run(run())
    assert first == {"video": ".mp4"}
    assert isinstance(second, ProblemError)
    assert (second.status, second.name) == (503, "unavailable")
