import struct

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.exports.mechanics import point_colors
from model.formats.ply import encode_ply


def with_ply(members: dict[str, bytes], old: bytes, new: bytes) -> dict[str, bytes]:
    assert old in members["gaussians.ply"]
    return {"gaussians.ply": members["gaussians.ply"].replace(old, new, 1)}


BROKEN = {
    "PLY of text": (
        lambda m: with_ply(m, b"binary_little_endian", b"ascii"),
        "gaussians.ply: expected format binary_little_endian 1.0, found 'format ascii 1.0'",
    ),
    "no PLY": (lambda m: {"gaussians.ply": b"solid cube"}, "gaussians.ply: expected a PLY file"),
    "PLY in another order": (
        lambda m: with_ply(m, b"float x\nproperty float y", b"float y\nproperty float x"),
        "expected the float properties x y z",
    ),
    "PLY of doubles": (lambda m: with_ply(m, b"float x", b"double x"), "expected the float properties x y z"),
    "PLY with a list": (
        lambda m: with_ply(m, b"end_header", b"property list uchar int faces\nend_header"),
        "expected the float properties",
    ),
    "PLY of faces": (lambda m: with_ply(m, b"vertex", b"face"), "expected `element vertex COUNT`"),
    "PLY too short": (
        lambda m: {"gaussians.ply": m["gaussians.ply"][:-4]},
        "gaussians.ply: expected 1836 bytes after the header (27 vertices), found 1832",
    ),
    "PLY too long": (lambda m: {"gaussians.ply": m["gaussians.ply"] + b"more"}, "found 1840"),
    "PLY without end": (
        lambda m: with_ply(m, b"vertex 27", b"vertex 999999999"),
        "expected 1 to 2000000 vertices",
    ),
    "PLY with NaN": (
        lambda m: {"gaussians.ply": m["gaussians.ply"][:-16] + struct.pack("<4f", np.nan, 0, 0, 1)},
        "property rot_0: expected finite",
    ),
    "PLY without rotation": (
        lambda m: {"gaussians.ply": m["gaussians.ply"][:-16] + bytes(16)},
        "property rot_0..3: expected quaternions",
    ),
    "PLY with huge scales": (
        lambda m: {"gaussians.ply": m["gaussians.ply"][:-20] + struct.pack("<5f", 200, 1, 0, 0, 0)},
        "property scale_0..2",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused(name: str, write_twin, members: dict[str, bytes], refusal):
    change, expected = BROKEN[name]
    assert expected in refusal(write_twin(files=change(members)))


def test_long_quaternions_become_unit(write_twin, members: dict[str, bytes]):
    long = members["gaussians.ply"][:-16] + struct.pack("<4f", 0, 3e38, 0, 3e38)
    turn = TwinBundle.load(write_twin(files={"gaussians.ply": long})).gaussians.quaternions[-1]
    np.testing.assert_allclose(turn, [0, np.sqrt(0.5), 0, np.sqrt(0.5)], rtol=1e-6)


def coefficients(data: bytes) -> np.ndarray:
    """`f_dc_0..2` of a file without further harmonics."""
    body = data.split(b"end_header\n", 1)[1]
    return np.frombuffer(body, "<f4").reshape(-1, 17)[:, 6:9]


def test_colours_that_cannot_be_drawn_are_kept(write_twin, members: dict[str, bytes]):
    """A splat from elsewhere is brighter than white and darker than black here and there."""
    head, body = members["gaussians.ply"].split(b"end_header\n", 1)
    rows = np.frombuffer(body, "<f4").reshape(-1, 17).copy()
    rows[0, 6:9], rows[1, 6:9] = 3.0, -3.0
    twin = TwinBundle.load(write_twin(files={"gaussians.ply": head + b"end_header\n" + rows.tobytes()}))
    np.testing.assert_allclose(coefficients(encode_ply(twin.gaussians)), rows[:, 6:9], atol=1e-6)
    twin.save(write_twin().parent / "again.twin.zip")
    again = TwinBundle.load(write_twin().parent / "again.twin.zip")
    np.testing.assert_allclose(coefficients(encode_ply(again.gaussians)), rows[:, 6:9], atol=1e-6)
    np.testing.assert_allclose(twin.gaussians.visible_colors[:3, 0], [1.0, 0.0, 0.5])
    np.testing.assert_allclose(point_colors(twin)[:3, 0], [1.0, 0.0, 0.5])
