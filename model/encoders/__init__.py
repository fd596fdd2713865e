"""Encoders: one image → dense features; how something moved → features of its points."""

from model.encoders.base import SemanticEncoder
from model.encoders.dinov2 import Dinov2Encoder
from model.encoders.kinematic import KinematicEncoder
from model.encoders.motion import MotionEncoder
from model.encoders.texture import TextureEncoder
from model.encoders.videomae import VideoMaeEncoder

ALL_ENCODERS: tuple[type[SemanticEncoder], ...] = (TextureEncoder, Dinov2Encoder)
"""The default first."""
ALL_MOTION_ENCODERS: tuple[type[MotionEncoder], ...] = (KinematicEncoder, VideoMaeEncoder)
"""The default first."""

__all__ = [
    "ALL_ENCODERS",
    "ALL_MOTION_ENCODERS",
    "Dinov2Encoder",
    "KinematicEncoder",
    "MotionEncoder",
    "SemanticEncoder",
    "TextureEncoder",
    "VideoMaeEncoder",
]
