"""A twin in the formats of other programs, one format per file."""

from model.errors import InputError
from model.exports.base import Exporter
from model.exports.glb import GlbExporter
from model.exports.mujoco import MujocoExporter
from model.exports.newton import NewtonExporter
from model.exports.phystwin import PhystwinExporter
from model.exports.ply import PlyExporter
from model.exports.usd import UsdExporter
from model.registry import by_name

ALL_EXPORTERS: tuple[type[Exporter], ...] = (
    GlbExporter,
    MujocoExporter,
    NewtonExporter,
    PhystwinExporter,
    PlyExporter,
    UsdExporter,
)


def exporter_of(name: str, *, every_frame: bool = False) -> Exporter:
    """The exporter of a format.

    Args:
        name: Of the format.
        every_frame: A file per frame, which PLY alone has.

    Raises:
        InputError: no such format, or frames of another.
    """
    if every_frame and name == PlyExporter.name:
        return PlyExporter(every_frame=True)
    exporter = by_name(ALL_EXPORTERS, name, "export")()
    if every_frame:
        raise InputError(f"--frames: {name} has its frames in one file, or none: ply alone has one for each")
    return exporter
