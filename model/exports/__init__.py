"""A twin in the formats of other programs, one format per file."""

from model.exports.base import Exporter
from model.exports.ply import PlyExporter

ALL_EXPORTERS: tuple[type[Exporter], ...] = (PlyExporter,)
