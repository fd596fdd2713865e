"""The Gaussians at rest, for any viewer of 3D Gaussian splats."""

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from model.exports.base import Exporter
from model.formats.files import replacing
from model.formats.ply import encode_ply

if TYPE_CHECKING:
    from model.bundle import TwinBundle


class PlyExporter(Exporter):
    """One 3DGS file: what `model.formats.ply` describes, in metres, z up.

    Reference:
        Kerbl, Kopanas, Leimkühler and Drettakis (2023), 3D Gaussian Splatting for Real-Time Radiance
        Field Rendering.
    """

    name: ClassVar[str] = "ply"

    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write the Gaussians at rest to the file `out`."""
        with replacing(out) as temporary:
            temporary.write_bytes(encode_ply(twin.gaussians))
        return [out]

    def lost(self, effect: str) -> str:
        """The file holds a shape, and no motion that could lack anything."""
        return f"ply: the file has the shape at rest alone, and so nothing of the effect {effect}"
