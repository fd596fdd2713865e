"""Semantic encoders: one image → dense features."""

from model.encoders.base import SemanticEncoder
from model.encoders.dinov2 import Dinov2Encoder
from model.encoders.texture import TextureEncoder

ALL_ENCODERS: tuple[type[SemanticEncoder], ...] = (TextureEncoder, Dinov2Encoder)
"""The default first."""

__all__ = ["ALL_ENCODERS", "Dinov2Encoder", "SemanticEncoder", "TextureEncoder"]
