"""The Gaussians, for any viewer of 3D Gaussian splats: at rest, or one file per frame."""

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from model.exports.base import Exporter
from model.exports.folder import write_folder
from model.exports.mechanics import roll
from model.exports.moving import EVERY_EFFECT, moving_gaussians
from model.exports.readme import FRAME, write_readme
from model.formats.files import replacing
from model.formats.ply import encode_ply

if TYPE_CHECKING:
    from model.bundle import TwinBundle

FRAMES = r"frame_\d{4,}\.ply"
MAGIC = b"ply\nformat binary_little_endian 1.0\n"
COMMENTS = 32_000
"""Bytes of the README that a header takes; readers give up on longer headers."""
PLAIN = str.maketrans({"·": "*", "²": "^2", "³": "^3", "×": "x", "−": "-", "–": "-", "…": "..."})
ATTRIBUTES = (
    "x y z m; nx ny nz 0; f_dc_0..2 and f_rest_* spherical harmonics of the colour (0.5 + sum); "
    "opacity a logit; scale_0..2 natural logarithms of m; rot_0..3 a quaternion w x y z"
)


class PlyExporter(Exporter):
    """3DGS files: what `model.formats.ply` describes, in metres, z up, the README in the header's comments.

    Args:
        every_frame: Write a folder with a file per frame of the recorded motion, not one file at rest.

    Reference:
        Kerbl, Kopanas, Leimkühler and Drettakis (2023), 3D Gaussian Splatting for Real-Time Radiance
        Field Rendering.
    """

    name: ClassVar[str] = "ply"
    simulated: ClassVar[bool] = False
    expressed: ClassVar[frozenset[str]] = EVERY_EFFECT  # the frames move with them, and at rest none shows

    def __init__(self, every_frame: bool = False) -> None:
        """See the class."""
        self.every_frame = every_frame

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the Gaussians at rest to the file `out`, or each frame into the folder `out`."""
        if not self.every_frame:
            limits = ["The file is the rest state: nothing in it moves, and nothing says how it would."]
            text = _readme(twin, [("this file", ATTRIBUTES)], [*limits, *self.losses(twin)])
            with replacing(out) as temporary:
                temporary.write_bytes(_with_comments(encode_ply(twin.gaussians), text))
            return [out]
        trajectory = roll(twin)
        fps = f"{(len(trajectory.times) - 1) / trajectory.times[-1]:g}" if len(trajectory.times) > 1 else "0"
        limits = [
            "Springs, masses and the hand are not in it.",
            "Harmonics above the first do not turn along.",
        ]
        names = [("frame_0000.ply …", f"{len(trajectory.times)} frames at {fps} per second: {ATTRIBUTES}")]
        files = {
            f"frame_{number:04d}.ply": encode_ply(gaussians)
            for number, gaussians in enumerate(moving_gaussians(twin, trajectory))
        }
        readme = {"README.md": _readme(twin, names, limits).encode()}
        return write_folder(out, files | readme, FRAMES)


def _readme(twin: "TwinBundle", files: list[tuple[str, str]], limits: list[str]) -> str:
    return write_readme(twin, "A MatPhys twin as 3D Gaussians", files=files, frame=FRAME, limits=limits)


def _with_comments(data: bytes, text: str) -> bytes:
    """The file with a text among the comments of its header, in ASCII as the format wants it."""
    plain = text.translate(PLAIN).encode("ascii", "replace")[:COMMENTS]
    comments = b"".join(b"comment " + line + b"\n" for line in plain.splitlines() if line.strip())
    return MAGIC + comments + data.removeprefix(MAGIC)
