"""What a malicious or careless client may send: each gets its problem, and nothing of it stays anywhere."""

import gzip
import io
import json
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import av
import httpx
import numpy as np
import pytest

RAW = {"Content-Type": "video/mp4"}


@dataclass(frozen=True)
class Hostile:
    """One request, and what it must get."""

    name: str
    status: int
    make: Callable[["Workshop"], dict]
    """Arguments for `httpx.Client.post`."""


class Workshop:
    """What hostile files are made of."""

    def __init__(self, clip: bytes, film: Callable[..., bytes]) -> None:
        self.clip, self.film = clip, film

    def beside_clip(self, name: str, content: bytes) -> dict:
        return {"files": {"video": ("clip.mp4", self.clip), name: (f"../{name}\0.png", content)}}

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


def raw(name: str, status: int, make: Callable[[Workshop], bytes]) -> Hostile:
    return Hostile(name, status, lambda shop: {"content": make(shop), "headers": RAW})


def beside(name: str, status: int, field: str, make: Callable[[Workshop], bytes]) -> Hostile:
    return Hostile(f"{field} {name}", status, lambda shop: shop.beside_clip(field, make(shop)))


def always(content: bytes) -> Callable[[Workshop], bytes]:
    return lambda shop: content


PLAYLIST = b"#EXTM3U\n#EXT-X-VERSION:3\n#EXTINF:1.0,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"
XXE = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><svg xmlns="http://www.w3.org/2000/svg">&e;</svg>'
LAUGHS = b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha"><!ENTITY b "' + b"&a;" * 1000 + b'">]><l>&b;</l>'
MPD = b'<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011"><BaseURL>file:///etc/</BaseURL></MPD>'


class Command:
    def __reduce__(self):
        return (print, ("this must never run",))


VIDEOS = [
    raw("empty", 422, always(b"")),
    raw("playlist", 415, always(PLAYLIST)),
    raw(
        "playlist over the network",
        415,
        always(PLAYLIST.replace(b"file:///etc/passwd", b"http://169.254.169.254/")),
    ),
    raw("playlist behind a byte order mark", 415, always(b"\xef\xbb\xbf" + PLAYLIST)),
    raw("concatenation", 415, always(b"ffconcat version 1.0\nfile '/etc/passwd'\n")),
    raw("concatenation protocol", 415, always(b"concat:/etc/passwd|/etc/hosts")),
    raw("manifest", 415, always(MPD)),
    raw(
        "session description",
        415,
        always(b"v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n"),
    ),
    raw("drawing with an entity", 415, always(XXE)),
    raw("a billion laughs", 415, always(LAUGHS)),
    raw("web page", 415, always(b"<!doctype html><script>alert(1)</script>")),
    raw("text", 415, always(b"the quick brown fox\n" * 100)),
    raw("subtitles", 415, always(b"1\n00:00:00,000 --> 00:00:01,000\nhello\n")),
    raw("zeros", 415, always(bytes(100_000))),
    raw("noise", 415, always(np.random.default_rng(0).bytes(100_000))),
    raw("picture", 415, lambda shop: shop.png(8, 8, bytes(72))),
    raw("animation", 415, always(b"GIF89a\x40\x00\x30\x00" + bytes(100))),
    raw("uncompressed", 415, always(b"YUV4MPEG2 W64 H48 F30:1 Ip A1:1\nFRAME\n" + bytes(64 * 48 * 3 // 2))),
    raw("archive bomb", 415, lambda shop: shop.bomb("clip.mp4")),
    raw("compressed clip", 415, lambda shop: gzip.compress(shop.clip)),
    raw("pickle", 415, always(pickle.dumps(Command()))),
    raw("program", 415, always(b"\x7fELF\x02\x01\x01" + bytes(1000))),
    raw("signature alone", 415, lambda shop: shop.clip[:24]),
    raw("cut in the header", 422, lambda shop: shop.clip[:200]),
    raw("cut in the pictures", 422, lambda shop: shop.clip[:-300]),
    raw("header of four gigabytes", 422, always(b"\xff\xff\xff\xffmoov" + bytes(5000))),
    raw("header of no length", 415, lambda shop: shop.patched(shop.clip, b"moov", -4, b"\x00\x00\x00\x02")),
    raw("four billion samples", 415, lambda shop: shop.patched(shop.clip, b"stsz", 12, b"\xff" * 4)),
    raw(
        "four gigapixels",
        422,
        lambda shop: shop.patched(
            shop.film(container="avi", codec="rawvideo"), b"strf", 12, struct.pack("<II", 65_500, 65_500)
        ),
    ),
    raw(
        "four gigapixels that come as a surprise",
        422,
        lambda shop: shop.patched(shop.jpegs(), b"\xff\xc0", 5, struct.pack(">HH", 65_500, 65_500)),
    ),
    raw(
        "garbage for pictures",
        422,
        lambda shop: (
            shop.clip[: shop.clip.index(b"mdat") + 4] + bytes(len(shop.clip) - shop.clip.index(b"mdat") - 4)
        ),
    ),
    raw("ninety seconds", 422, lambda shop: shop.film(frames=90, rate=1)),
    raw("cut matroska", 415, lambda shop: shop.film(container="matroska")[:40]),
    raw(
        "matroska without pictures",
        415,
        lambda shop: shop.film(container="matroska").partition(b"\x1f\x43\xb6\x75")[0],
    ),
    raw("sound alone", 422, lambda shop: shop.sound()),
    raw("transport stream of noise", 415, always(b"G" + bytes(187) * 40)),
]
COMPANIONS = [
    beside("bomb", 422, "controllers", lambda shop: shop.bomb("controllers.npy", 600 << 20)),
    beside("bomb in disguise", 422, "controllers", lambda shop: shop.bomb("controllers.npy", 100)),
    beside("NaN", 422, "controllers", lambda shop: shop.npz(controllers=np.full((6, 1, 3), np.nan))),
    beside(
        "infinite times",
        422,
        "controllers",
        lambda shop: shop.npz(controllers=np.zeros((2, 1, 3)), times=np.array([0, np.inf])),
    ),
    beside(
        "pickle inside",
        422,
        "controllers",
        lambda shop: shop.npz(controllers=np.array([Command()], dtype=object)),
    ),
    beside("pickle", 415, "controllers", always(pickle.dumps(Command()))),
    beside("of another shape", 422, "controllers", lambda shop: shop.npz(controllers=np.zeros(3))),
    beside("without the array", 422, "controllers", lambda shop: shop.npz(points=np.zeros((2, 1, 3)))),
    beside(
        "that climbs",
        422,
        "controllers",
        lambda shop: shop.zipped(**{"../../evil.npy": b"x", "controllers.npy": b"x"}),
    ),
    beside(
        "of a million members",
        422,
        "controllers",
        lambda shop: shop.zipped(**{f"{i}.npy": b"" for i in range(5000)}),
    ),
    beside(
        "that claims a terabyte",
        422,
        "controllers",
        lambda shop: shop.zipped(**{"controllers.npy": shop.npy("(1000000000, 40, 3)")}),
    ),
    beside(
        "that lies about its header",
        422,
        "controllers",
        lambda shop: shop.zipped(**{"controllers.npy": shop.npy("__import__('os')")}),
    ),
    beside("cut", 422, "controllers", lambda shop: shop.npz(controllers=np.zeros((6, 1, 3)))[:-30]),
    beside("of text", 415, "controllers", always(b"0 0 0\n")),
    beside("NaN", 415, "camera", always(b'{"intrinsics": [[NaN, 0, 1], [0, 1, 1], [0, 0, 1]]}')),
    beside("too deep", 415, "camera", always(b"[" * 500_000)),
    beside("too large", 413, "camera", always(b'{"intrinsics": ' + b" " * (1 << 20))),
    beside(
        "number too large", 422, "camera", always(b'{"intrinsics": [[1e999, 0, 1], [0, 1, 1], [0, 0, 1]]}')
    ),
    beside(
        "of another program",
        422,
        "camera",
        always(json.dumps({"intrinsics": [[1, 0, 0]] * 3, "exec": "rm"}).encode()),
    ),
    beside("an entity", 415, "camera", always(XXE)),
    beside("drawing", 415, "mask", always(XXE)),
    beside("of four gigapixels", 422, "mask", lambda shop: shop.png(65_535, 65_535)),
    beside("cut", 422, "mask", lambda shop: shop.png(64, 48, bytes(65 * 48))[:-20]),
    beside(
        "with a wrong checksum",
        422,
        "mask",
        lambda shop: shop.patched(shop.png(64, 48, bytes(65 * 48)), b"IDAT", 6, b"\x99"),
    ),
    beside("playlist", 415, "mask", always(PLAYLIST)),
    beside("web page", 415, "mesh", always(b"<!doctype html><script>alert(1)</script>")),
    beside("cut GLB", 422, "mesh", always(b"glTF" + struct.pack("<III", 2, 1 << 31, 100) + b"JSON{}")),
    beside(
        "points alone",
        422,
        "mesh",
        always(b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n"),
    ),
    beside("one endless line", 415, "mesh", always(b"v " + b"0" * 1_000_000)),
    beside("pickle", 422, "depth", lambda shop: shop.npy("(1,)", "|O", pickle.dumps(Command()))),
    beside("that claims a terabyte", 422, "depth", lambda shop: shop.npy("(1000000, 1000000)")),
    beside("text", 415, "depth", always(b"0.4 0.4\n")),
]
CLIP_PART = b'--b\r\nContent-Disposition: form-data; name="video"; filename="c"\r\n\r\n'
FORMS = [
    Hostile(
        "form without a boundary",
        400,
        lambda shop: {"content": b"--b", "headers": {"Content-Type": "multipart/form-data"}},
    ),
    Hostile("form with an endless boundary", 400, lambda shop: shop.form(b"--b", "b" * 2000)),
    Hostile("form that is none", 400, lambda shop: shop.form(b"not a form at all")),
    Hostile("form that breaks off", 400, lambda shop: shop.form(CLIP_PART + shop.clip)),
    Hostile(
        "form with a clip twice",
        400,
        lambda shop: shop.form((CLIP_PART + shop.clip + b"\r\n") * 2 + b"--b--\r\n"),
    ),
    Hostile(
        "part without a name",
        400,
        lambda shop: shop.form(b"--b\r\nContent-Disposition: form-data\r\n\r\nx\r\n--b--\r\n"),
    ),
    Hostile("part without a disposition", 400, lambda shop: shop.form(b"--b\r\nX: y\r\n\r\nx\r\n--b--\r\n")),
    Hostile(
        "part with endless headers",
        400,
        lambda shop: shop.form(b"--b\r\n" + b"X: y\r\n" * 10_000 + b"\r\nx\r\n--b--\r\n"),
    ),
    Hostile(
        "part with a huge header",
        400,
        lambda shop: shop.form(b"--b\r\nX: " + b"y" * 200_000 + b"\r\n\r\nx\r\n--b--\r\n"),
    ),
    Hostile(
        "a thousand parts",
        400,
        lambda shop: {"files": {"video": shop.clip}, "data": {f"f{i}": "x" for i in range(1000)}},
    ),
    Hostile(
        "huge field",
        413,
        lambda shop: {"files": {"video": shop.clip}, "data": {"webhook": "https://" + "x" * 1_000_000}},
    ),
    Hostile(
        "field that climbs", 422, lambda shop: {"files": {"video": shop.clip, "../../../tmp/evil": b"x"}}
    ),
    Hostile(
        "field that is no text",
        400,
        lambda shop: shop.form(
            b'--b\r\nContent-Disposition: form-data; name="shape"\r\n\r\n\xff\xfe\r\n--b--\r\n'
        ),
    ),
    Hostile("not a number", 422, lambda shop: {"files": {"video": shop.clip}, "data": {"size_m": "NaN"}}),
    Hostile(
        "webhook with a line break",
        422,
        lambda shop: {"files": {"video": shop.clip}, "data": {"webhook": "https://x/\r\nHost: y"}},
    ),
    Hostile("JSON", 415, lambda shop: {"json": {"video": "file:///etc/passwd"}}),
    Hostile(
        "address of a clip", 415, lambda shop: {"data": {"video": "http://169.254.169.254/latest/meta-data"}}
    ),
    Hostile(
        "type that is none", 415, lambda shop: {"content": shop.clip, "headers": {"Content-Type": b";;;\xff"}}
    ),
    Hostile(
        "compressed body",
        415,
        lambda shop: {"content": gzip.compress(shop.clip), "headers": RAW | {"Content-Encoding": "gzip"}},
    ),
    Hostile("too large", 413, lambda shop: {"content": bytes(6 << 20), "headers": RAW}),
    Hostile(
        "too large, of unknown length",
        413,
        lambda shop: {"content": (bytes(1 << 16) for _ in range(200)), "headers": RAW},
    ),
]
CORPUS = VIDEOS + COMPANIONS + FORMS


@pytest.fixture(scope="module")
def http(patient):
    with patient.client() as client:
        yield client


@pytest.mark.parametrize("hostile", CORPUS, ids=lambda hostile: hostile.name)
def test_it_gets_its_problem_and_nothing_stays(patient, http, clip, film, hostile):
    before = patient.stored()
    try:
        answer = http.post("/twins", **hostile.make(Workshop(clip, film)))
    except httpx.WriteError:
        assert hostile.status == 413  # the connection is closed upon a client that goes on sending
    else:
        assert answer.status_code == hostile.status, answer.text
        assert answer.headers["Content-Type"] == "application/problem+json"
        problem = answer.json()
        assert problem["status"] == hostile.status
        assert problem["detail"].isprintable()
        for secret in (str(patient.settings.data_dir), "Traceback", "root:", "/work", "worker."):
            assert secret not in answer.text
    assert http.get("/livez").status_code == 200
    assert list(patient.settings.staging.iterdir()) == []
    assert patient.stored() == before


def test_the_corpus_is_large_enough_and_tells_its_cases_apart():
    assert len(CORPUS) >= 40
    assert len({hostile.name for hostile in CORPUS}) == len(CORPUS)


def test_nothing_was_accepted_on_the_way(patient, http):
    assert http.get("/twins").json()["items"] == []
    assert patient.records.depth("twins") == 0
