"""The 3DGS file of Gaussians: binary PLY, as every splat viewer reads it.

Little-endian float32 in the order `x y z nx ny nz f_dc_0..2 f_rest_* opacity scale_0..2 rot_0..3`;
opacity is a logit, scales are natural logarithms, rotations are quaternions w x y z, and the colour is
the first spherical-harmonic coefficient.

Reference:
    Kerbl, Kopanas, Leimkühler and Drettakis (2023), 3D Gaussian Splatting for Real-Time Radiance
    Field Rendering.
"""

import re

import numpy as np
from jaxtyping import Float32

from model.errors import InputError
from model.types import Array, Gaussians

HARMONIC_0 = 0.28209479177387814
"""The constant spherical harmonic Y₀₀ = 1 / (2 sqrt(π))."""
VERTEX_LIMIT = 2_000_000
HEADER_LIMIT = 1 << 16
MOST_HARMONICS = 45
"""Coefficients of degree 1 to 3 in three channels."""
OPACITY_MARGIN = 1e-6
BEFORE = ("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2")
AFTER = ("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")


def encode_ply(gaussians: Gaussians) -> bytes:
    """Write Gaussians as a 3DGS file."""
    count = len(gaussians)
    opacity = np.clip(gaussians.opacities.astype(np.float64), OPACITY_MARGIN, 1 - OPACITY_MARGIN)
    harmonics = gaussians.harmonics if gaussians.harmonics is not None else np.zeros((count, 0))
    columns = [
        gaussians.means,
        np.zeros((count, 3)),
        (gaussians.colors.astype(np.float64) - 0.5) / HARMONIC_0,
        harmonics,
        np.log(opacity / (1 - opacity))[:, None],
        np.log(gaussians.scales.astype(np.float64)),
        gaussians.quaternions,
    ]
    body = np.concatenate(columns, axis=1).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property float {name}" for name in _names(harmonics.shape[1])]
    return "\n".join([*header, "end_header\n"]).encode() + body.tobytes()


def decode_ply(data: bytes, where: str) -> Gaussians:
    """Read a 3DGS file.

    The file does not say what volume each Gaussian stands for: `volumes` is that of its one-sigma ellipsoid.

    Args:
        data: The file.
        where: Its name, for the message.

    Raises:
        InputError: not a 3DGS file as the top of this module has it, or numbers no Gaussian can have.
    """
    count, harmonics, start = _parse_header(data, where)
    width = len(BEFORE) + harmonics + len(AFTER)
    expected, found = count * width * 4, len(data) - start
    if found != expected:
        raise InputError(
            f"{where}: expected {expected} bytes after the header ({count} vertices), found {found}"
        )
    rows = np.frombuffer(data, "<f4", offset=start).reshape(count, width).astype(np.float32)
    finite = np.isfinite(rows).all(axis=0)
    if not finite.all():
        name = _names(harmonics)[int(np.argmin(finite))]
        raise InputError(f"{where}: property {name}: expected finite numbers, found NaN or infinity")
    return _gaussians(rows, harmonics, where)


def _gaussians(rows: Float32[Array, "G P"], harmonics: int, where: str) -> Gaussians:
    first = len(BEFORE) + harmonics
    with np.errstate(over="ignore", under="ignore"):
        scales = np.exp(rows[:, first + 1 : first + 4])
        opacities = (1 / (1 + np.exp(-rows[:, first].astype(np.float64)))).astype(np.float32)
    if not (np.isfinite(scales).all() and (scales > 0).all()):
        raise InputError(
            f"{where}: property scale_0..2: expected logarithms of metres, found values out of range"
        )
    turns = rows[:, first + 4 :].astype(np.float64)
    norms = np.linalg.norm(turns, axis=1, keepdims=True)
    if not (norms > 1e-12).all():
        raise InputError(f"{where}: property rot_0..3: expected quaternions, found one of length zero")
    return Gaussians(
        means=rows[:, :3].copy(),
        scales=scales,
        quaternions=(turns / norms).astype(np.float32),
        opacities=np.clip(opacities, np.float32(OPACITY_MARGIN), np.float32(1 - OPACITY_MARGIN)),
        colors=rows[:, 6:9] * np.float32(HARMONIC_0) + np.float32(0.5),
        volumes=np.float32(4 / 3 * np.pi) * scales.prod(axis=1),
        harmonics=rows[:, len(BEFORE) : first].copy() if harmonics else None,
    )


def _parse_header(data: bytes, where: str) -> tuple[int, int, int]:
    """Number of vertices, number of higher harmonics, and where the body starts."""
    end = data.find(b"end_header\n", 0, HEADER_LIMIT)
    if not data.startswith(b"ply\n") or end < 0:
        raise InputError(f"{where}: expected a PLY file, found no PLY header")
    lines = [line.split() for line in data[:end].decode("latin-1").splitlines()[1:]]
    lines = [words for words in lines if words and words[0] not in ("comment", "obj_info")]
    if lines[:1] != [["format", "binary_little_endian", "1.0"]]:
        raise InputError(f"{where}: expected format binary_little_endian 1.0, found {_say(lines[:1])}")
    count = _vertex_count(lines[1:2], where)
    names = [words[2] for words in lines[2:] if len(words) == 3 and words[0] == "property"]
    kinds = {words[1] for words in lines[2:] if len(words) == 3}
    harmonics = len(names) - len(BEFORE) - len(AFTER)
    whole = len(names) == len(lines) - 2 and kinds <= {"float", "float32"}
    if not whole or not 0 <= harmonics <= MOST_HARMONICS or harmonics % 3 or names != _names(harmonics):
        order = "x y z nx ny nz f_dc_0..2 f_rest_* opacity scale_0..2 rot_0..3"
        raise InputError(f"{where}: expected the float properties {order}, found {_say(lines[2:])}")
    return count, harmonics, end + len(b"end_header\n")


def _vertex_count(line: list[list[str]], where: str) -> int:
    words = line[0] if line else []
    if len(words) != 3 or words[:2] != ["element", "vertex"] or not re.fullmatch(r"[0-9]{1,9}", words[2]):
        raise InputError(f"{where}: expected `element vertex COUNT`, found {_say(line)}")
    count = int(words[2])
    if not 1 <= count <= VERTEX_LIMIT:
        raise InputError(f"{where}: expected 1 to {VERTEX_LIMIT} vertices, found {count}")
    return count


def _names(harmonics: int) -> list[str]:
    return [*BEFORE, *(f"f_rest_{i}" for i in range(harmonics)), *AFTER]


def _say(lines: list[list[str]]) -> str:
    text = "; ".join(" ".join(words) for words in lines) or "nothing"
    return repr(text if len(text) <= 80 else text[:77] + "...")
