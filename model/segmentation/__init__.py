"""Frames → Masks: where the handled object and the hand are, in every frame."""

from model.segmentation.base import Segmenter
from model.segmentation.classical import ClassicalSegmenter

ALL_SEGMENTERS: tuple[type[Segmenter], ...] = (ClassicalSegmenter,)
"""Every segmentation method, the default first."""

__all__ = ["ALL_SEGMENTERS", "ClassicalSegmenter", "Segmenter"]
