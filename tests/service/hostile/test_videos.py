"""Files that are sent as clips and are none, or are broken ones."""

import gzip
import struct
from collections.abc import Callable

import numpy as np
import pytest


def raw(name: str, status: int, make: Callable):
    return pytest.param(
        status, lambda shop: {"content": make(shop), "headers": {"Content-Type": "video/mp4"}}, id=name
    )


def always(content: bytes) -> Callable:
    return lambda shop: content


LAUGHS = b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha"><!ENTITY b "' + b"&a;" * 1000 + b'">]><l>&b;</l>'
MPD = b'<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011"><BaseURL>file:///etc/</BaseURL></MPD>'
CASES = [
    raw("empty", 422, always(b"")),
    raw("playlist", 415, lambda shop: shop.PLAYLIST),
    raw(
        "playlist over the network",
        415,
        lambda shop: shop.PLAYLIST.replace(b"file:///etc/passwd", b"http://169.254.169.254/"),
    ),
    raw("playlist behind a byte order mark", 415, lambda shop: b"\xef\xbb\xbf" + shop.PLAYLIST),
    raw("concatenation", 415, always(b"ffconcat version 1.0\nfile '/etc/passwd'\n")),
    raw("concatenation protocol", 415, always(b"concat:/etc/passwd|/etc/hosts")),
    raw("manifest", 415, always(MPD)),
    raw(
        "session description",
        415,
        always(b"v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n"),
    ),
    raw("drawing with an entity", 415, lambda shop: shop.ENTITY),
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
    raw("pickle", 415, lambda shop: shop.pickled()),
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


@pytest.mark.parametrize(("status", "make"), CASES)
def test_it_gets_its_problem_and_nothing_stays(check, status, make):
    check(status, make)
