"""What a malicious or careless client may send: each gets its problem, and nothing of it stays anywhere."""

import io
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable

import av
import httpx
import numpy as np
import pytest


class Command:
    """Would run something if it were unpickled."""

    def __reduce__(self):
        return (print, ("this must never run",))


class Workshop:
    """What hostile files are made of."""

    PLAYLIST = b"#EXTM3U\n#EXT-X-VERSION:3\n#EXTINF:1.0,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"
    ENTITY = (
        b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
        b'<svg xmlns="http://www.w3.org/2000/svg">&e;</svg>'
    )

    def __init__(self, clip: bytes, film: Callable[..., bytes]) -> None:
        self.clip, self.film = clip, film

    def beside_clip(self, name: str, content: bytes) -> dict:
        return {"files": {"video": ("clip.mp4", self.clip), name: (f"../{name}\0.png", content)}}

    def pickled(self) -> bytes:
        return pickle.dumps(Command())

    def npz(self, **arrays) -> bytes:
        target = io.BytesIO()
        np.savez(target, **arrays)
        return target.getvalue()

    def jpegs(self) -> bytes:
        return self.film(container="avi", codec="mjpeg")

    def sound(self) -> bytes:
        target = io.BytesIO()
        with av.open(target, "w", format="mp4") as out:
            stream = out.add_stream("aac", rate=44_100)
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
            frame.rate = 44_100
            for packet in (*stream.encode(frame), *stream.encode()):
                out.mux(packet)
        return target.getvalue()

    def zipped(self, **members: bytes) -> bytes:
        target = io.BytesIO()
        with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        return target.getvalue()

    def bomb(self, member: str, claimed: int | None = None) -> bytes:
        """64 MiB of zeros in 64 KiB, which may claim to be more, or less."""
        bomb = self.zipped(**{member: bytes(64 << 20)})
        size = struct.pack("<I", 64 << 20)
        return bomb if claimed is None else bomb.replace(size, struct.pack("<I", claimed))

    def npy(self, shape: str, dtype: str = "<f8", data: bytes = b"") -> bytes:
        header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
        return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data

    def png(self, width: int, height: int, pixels: bytes = b"") -> bytes:
        def chunk(name: bytes, data: bytes) -> bytes:
            return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

        header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
        return (
            b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(pixels))
            + chunk(b"IEND", b"")
        )

    def patched(self, content: bytes, box: bytes, offset: int, value: bytes) -> bytes:
        at = content.index(box) + offset
        return content[:at] + value + content[at + len(value) :]

    def form(self, body: bytes, boundary: str = "b") -> dict:
        return {"content": body, "headers": {"Content-Type": f"multipart/form-data; boundary={boundary}"}}


@pytest.fixture(scope="session")
def shop(clip, film) -> Workshop:
    return Workshop(clip, film)


@pytest.fixture(scope="module")
def http(patient):
    with patient.client() as client:
        yield client


@pytest.fixture
def check(patient, http, shop):
    """Sends what `make(shop)` makes; the answer must be a problem, and nothing may have changed."""

    def check(status: int, make: Callable[[Workshop], dict]) -> None:
        before = patient.stored()
        try:
            answer = http.post("/twins", **make(shop))
        except httpx.WriteError:
            assert status == 413  # the connection is closed upon a client that goes on sending
        else:
            assert answer.status_code == status, answer.text
            assert answer.headers["Content-Type"] == "application/problem+json"
            problem = answer.json()
            assert problem["status"] == status
            assert problem["detail"].isprintable()
            for secret in (str(patient.settings.data_dir), "Traceback", "root:", "/work", "worker."):
                assert secret not in answer.text
        assert http.get("/livez").status_code == 200
        assert list(patient.settings.staging.iterdir()) == []
        assert patient.stored() == before
        assert patient.records.depth("twins") == 0

    return check
