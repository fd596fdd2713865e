"""Frames → Masks: where the handled object and the hand are, in every frame."""

from model.segmentation.base import Segmenter
from model.segmentation.classical import ClassicalSegmenter
from model.segmentation.sam2 import Sam2Segmenter

ALL_SEGMENTERS: tuple[type[Segmenter], ...] = (ClassicalSegmenter, Sam2Segmenter)
"""Every segmentation method, the default first."""

__all__ = ["ALL_SEGMENTERS", "ClassicalSegmenter", "Sam2Segmenter", "Segmenter"]
