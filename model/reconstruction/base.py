"""Keyframe → Gaussians: the seam every reconstruction fills."""

from abc import ABC, abstractmethod
from typing import ClassVar

from model.types import Calibration, Frames, Gaussians, Masks, ShapeClass


class Reconstructor(ABC):
    """Turns the object on the keyframe into 3D Gaussians that fill its volume."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None = None

    @abstractmethod
    def __call__(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> Gaussians:
        """Reconstruct the object on `masks.keyframe` in the world of `calibration`."""

    @abstractmethod
    def extent(
        self, frames: Frames, masks: Masks, calibration: Calibration, shape_class: ShapeClass
    ) -> float:
        """Largest extent [m] of what would be reconstructed: what a stated size is compared with."""
