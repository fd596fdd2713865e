"""Frames → Tracks: the seam every tracker fills."""

from abc import ABC, abstractmethod
from typing import ClassVar

from jaxtyping import Float32

from model.types import Array, Frames, Tracks


class Tracker(ABC):
    """Follows pixels of the keyframe through the clip, forwards and backwards."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None = None

    @abstractmethod
    def __call__(self, frames: Frames, queries: Float32[Array, "N 2"], keyframe: int) -> Tracks:
        """Track `queries` [px], given on the keyframe, through every frame."""
