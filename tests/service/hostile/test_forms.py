"""Requests that are not what they say they are."""

import gzip
from collections.abc import Callable

import pytest

RAW = {"Content-Type": "video/mp4"}


def form(name: str, status: int, make: Callable):
    return pytest.param(status, make, id=name)


CLIP_PART = b'--b\r\nContent-Disposition: form-data; name="video"; filename="c"\r\n\r\n'
CASES = [
    form(
        "form without a boundary",
        400,
        lambda shop: {"content": b"--b", "headers": {"Content-Type": "multipart/form-data"}},
    ),
    form("form with an endless boundary", 400, lambda shop: shop.form(b"--b", "b" * 2000)),
    form("form that is none", 400, lambda shop: shop.form(b"not a form at all")),
    form("form that breaks off", 400, lambda shop: shop.form(CLIP_PART + shop.clip)),
    form(
        "form with a clip twice",
        400,
        lambda shop: shop.form((CLIP_PART + shop.clip + b"\r\n") * 2 + b"--b--\r\n"),
    ),
    form(
        "part without a name",
        400,
        lambda shop: shop.form(b"--b\r\nContent-Disposition: form-data\r\n\r\nx\r\n--b--\r\n"),
    ),
    form("part without a disposition", 400, lambda shop: shop.form(b"--b\r\nX: y\r\n\r\nx\r\n--b--\r\n")),
    form(
        "part with endless headers",
        400,
        lambda shop: shop.form(b"--b\r\n" + b"X: y\r\n" * 10_000 + b"\r\nx\r\n--b--\r\n"),
    ),
    form(
        "part with a huge header",
        400,
        lambda shop: shop.form(b"--b\r\nX: " + b"y" * 200_000 + b"\r\n\r\nx\r\n--b--\r\n"),
    ),
    form(
        "a thousand parts",
        400,
        lambda shop: {"files": {"video": shop.clip}, "data": {f"f{i}": "x" for i in range(1000)}},
    ),
    form(
        "huge field",
        413,
        lambda shop: {"files": {"video": shop.clip}, "data": {"webhook": "https://" + "x" * 1_000_000}},
    ),
    form("field that climbs", 422, lambda shop: {"files": {"video": shop.clip, "../../../tmp/evil": b"x"}}),
    form("file by a name that none has", 422, lambda shop: {"files": {"file": shop.clip}}),
    form(
        "field that is no text",
        400,
        lambda shop: shop.form(
            b'--b\r\nContent-Disposition: form-data; name="shape"\r\n\r\n\xff\xfe\r\n--b--\r\n'
        ),
    ),
    form("not a number", 422, lambda shop: {"files": {"video": shop.clip}, "data": {"size_m": "NaN"}}),
    form(
        "webhook with a line break",
        422,
        lambda shop: {"files": {"video": shop.clip}, "data": {"webhook": "https://x/\r\nHost: y"}},
    ),
    form("JSON", 415, lambda shop: {"json": {"video": "file:///etc/passwd"}}),
    form(
        "address of a clip", 415, lambda shop: {"data": {"video": "http://169.254.169.254/latest/meta-data"}}
    ),
    form(
        "type that is none", 415, lambda shop: {"content": shop.clip, "headers": {"Content-Type": b";;;\xff"}}
    ),
    form(
        "compressed body",
        415,
        lambda shop: {"content": gzip.compress(shop.clip), "headers": RAW | {"Content-Encoding": "gzip"}},
    ),
    form("too large", 413, lambda shop: {"content": bytes(6 << 20), "headers": RAW}),
    form(
        "too large, of unknown length",
        413,
        lambda shop: {"content": (bytes(1 << 16) for _ in range(200)), "headers": RAW},
    ),
]


@pytest.mark.parametrize(("status", "make"), CASES)
def test_it_gets_its_problem_and_nothing_stays(check, status, make):
    check(status, make)
