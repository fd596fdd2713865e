"""Files that are sent beside a good clip and are not what they should be."""

import json
import struct
from collections.abc import Callable

import numpy as np
import pytest


def beside(name: str, status: int, field: str, make: Callable):
    return pytest.param(status, lambda shop: shop.beside_clip(field, make(shop)), id=f"{field} {name}")


def always(content: bytes) -> Callable:
    return lambda shop: content


CASES = [
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
        lambda shop: shop.npz(controllers=np.array([{}, "x"], dtype=object)),
    ),
    beside("pickle", 415, "controllers", lambda shop: shop.pickled()),
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
    beside("an entity", 415, "camera", lambda shop: shop.ENTITY),
    beside("drawing", 415, "mask", lambda shop: shop.ENTITY),
    beside("of four gigapixels", 422, "mask", lambda shop: shop.png(65_535, 65_535)),
    beside("cut", 422, "mask", lambda shop: shop.png(64, 48, bytes(65 * 48))[:-20]),
    beside(
        "with a wrong checksum",
        422,
        "mask",
        lambda shop: shop.patched(shop.png(64, 48, bytes(65 * 48)), b"IDAT", 6, b"\x99"),
    ),
    beside("playlist", 415, "mask", lambda shop: shop.PLAYLIST),
    beside("web page", 415, "mesh", always(b"<!doctype html><script>alert(1)</script>")),
    beside("cut GLB", 422, "mesh", always(b"glTF" + struct.pack("<III", 2, 1 << 31, 100) + b"JSON{}")),
    beside(
        "points alone",
        422,
        "mesh",
        always(b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n"),
    ),
    beside("one endless line", 415, "mesh", always(b"v " + b"0" * 1_000_000)),
    beside("pickle", 422, "depth", lambda shop: shop.npy("(1,)", "|O", shop.pickled())),
    beside("that claims a terabyte", 422, "depth", lambda shop: shop.npy("(1000000, 1000000)")),
    beside("text", 415, "depth", always(b"0.4 0.4\n")),
]


@pytest.mark.parametrize(("status", "make"), CASES)
def test_it_gets_its_problem_and_nothing_stays(check, status, make):
    check(status, make)
