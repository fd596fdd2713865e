import asyncio
import logging
import socket
import subprocess
import sys
import time
from urllib.parse import urlsplit

import pytest

from service.errors import ProblemError
from service.uploads import Intake


@pytest.fixture
def intake(tmp_path):
    intake = Intake(tmp_path / "staging", max_bytes=1000, min_free_bytes=0, idle_seconds=1.0)
    intake.sweep()
    return intake


def begin(serving, length: int = 1000) -> socket.socket:
    """A client that has sent the head of an upload and a part of its body."""
    _, key = serving.keys.create("a", "default", ("submit",))
    address = urlsplit(serving.url)
    connection = socket.create_connection((address.hostname, address.port), timeout=10)
    lines = (
        "POST /twins HTTP/1.1",
        "Host: x",
        f"Authorization: Bearer {key}",
        f"Content-Length: {length}",
        "",
        "",
    )
    connection.sendall("\r\n".join(lines).encode() + b"x" * 100)
    return connection


def gone(serving, seconds: float = 5.0) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if not any(serving.settings.staging.iterdir()):
            return True
        time.sleep(0.02)
    return False


def staged(serving) -> None:
    while not serving.staged():
        time.sleep(0.01)


def test_an_upload_that_stalls_is_given_up(serve):
    serving = serve(idle_seconds=0.3)
    with begin(serving) as connection:
        answer = connection.recv(65536)
    assert answer.startswith(b"HTTP/1.1 408")
    assert b"application/problem+json" in answer
    assert gone(serving)


def test_a_client_that_hangs_up_leaves_nothing_and_is_no_error(serving, caplog):
    with caplog.at_level(logging.INFO, "matphys.access"):
        with begin(serving):
            staged(serving)
        assert gone(serving)
        while not caplog.records:
            time.sleep(0.01)
    assert serving.stored() == []
    assert [(record.levelname, record.status) for record in caplog.records] == [("INFO", 499)]


def test_what_a_killed_front_left_is_swept_and_nothing_else(intake):
    """The kernel lets go of a folder when its process is killed; what is being taken in stays."""
    hold = (
        "import sys; from pathlib import Path; from service.uploads import Intake\n"
        "intake = Intake(Path(sys.argv[1]), 1, 0, 1.0)\n"
        "intake._claim(intake.staging / 'theirs'); print('held', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", hold, str(intake.staging)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout.readline() == "held\n"
    (intake.staging / "theirs" / "video").write_bytes(b"x")
    intake.sweep()
    assert (intake.staging / "theirs" / "video").exists()
    other.kill()
    other.communicate()
    intake.sweep()
    assert list(intake.staging.iterdir()) == []


class FakeRequest:
    """As much of a request as an upload needs."""

    def __init__(self, *chunks: bytes, **headers: str) -> None:
        self.chunks = list(chunks)
        self.headers = {name.replace("_", "-"): value for name, value in headers.items()}

    async def stream(self):
        while self.chunks:
            yield self.chunks.pop(0)


def receive(intake, request, limits=None):
    async def run():
        async with intake.receive(request, limits or {"video": 1000}) as upload:
            return {
                name: (file.path.read_bytes(), file.bytes, file.sha256) for name, file in upload.files.items()
            }

    try:
        return asyncio.run(run())
    finally:
        assert list(intake.staging.iterdir()) == []


def test_pieces_become_one_file_with_its_hash(intake):
    files = receive(intake, FakeRequest(b"ab", b"", b"c"))
    assert files == {"video": (b"abc", 3, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")}


def test_a_disk_that_fills_up_is_a_problem_that_leaves_nothing(intake, monkeypatch):
    import errno

    from service import uploads
    from service.errors import translate

    class Full(uploads.FileIO):
        def write(self, data):
            if self.tell() >= 2:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(bytes(data)[:2])

    monkeypatch.setattr(uploads, "FileIO", Full)
    with pytest.raises(OSError, match="No space") as error:
        receive(intake, FakeRequest(b"abcdef"))
    problem = translate(error.value)
    assert (problem.status, problem.name) == (503, "no-space")


def test_no_room_is_said_before_a_byte_is_read(intake):
    from dataclasses import replace

    full = replace(intake, min_free_bytes=10**18)
    request = FakeRequest(b"abc")
    with pytest.raises(ProblemError, match="try again later"):
        receive(full, request)
    assert request.chunks == [b"abc"]


def test_room_is_looked_at_again_while_a_body_comes(intake, monkeypatch):
    """Chunked, it does not say how large it is."""
    monkeypatch.setattr("service.uploads.CHECKED_BYTES", 3)
    room = [10, 10, -1]
    monkeypatch.setattr(type(intake), "free_bytes", lambda self: room.pop(0))
    request = FakeRequest(b"abc", b"def", b"ghi")
    with pytest.raises(ProblemError, match="try again later"):
        receive(intake, request)
    assert request.chunks == [b"ghi"]


def test_a_body_that_drips_is_given_up(intake, monkeypatch):
    monkeypatch.setattr("service.uploads.DRIP_SECONDS", 0.0)
    monkeypatch.setattr("service.uploads.DRIP_BYTES", 10**9)
    with pytest.raises(ProblemError, match="1 bytes came in 0 s: at least") as refused:
        receive(intake, FakeRequest(b"a", b"b", b"c"))
    assert refused.value.name == "upload-stalled"


def test_each_file_has_its_own_limit(intake):
    form = (
        b'--b\r\nContent-Disposition: form-data; name="video"\r\n\r\nabc\r\n'
        b'--b\r\nContent-Disposition: form-data; name="mask"\r\n\r\nabc\r\n--b--\r\n'
    )
    kind = "multipart/form-data; boundary=b"
    for size in (1, 7, 4096):
        pieces = [form[at : at + size] for at in range(0, len(form), size)]
        files = receive(intake, FakeRequest(*pieces, content_type=kind), {"video": 3, "mask": 3})
        assert {name: content for name, (content, _, _) in files.items()} == {"video": b"abc", "mask": b"abc"}
    with pytest.raises(ProblemError, match="mask: at most 2 bytes"):
        receive(intake, FakeRequest(form, content_type=kind), {"video": 3, "mask": 2})
