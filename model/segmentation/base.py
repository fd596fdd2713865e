"""Frames → Masks: the seam every segmentation method fills."""

from abc import ABC, abstractmethod
from typing import ClassVar

from model.types import Frames, Masks, Prompt


class Segmenter(ABC):
    """Finds the handled object and the hand in every frame."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None = None
    """sha256 of the weights file, or None where there are none."""

    @abstractmethod
    def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
        """Segment the clip.

        Args:
            frames: The clip.
            prompt: What the user says about the keyframe; overrides what the method would find.

        Raises:
            InputError: no object can be found, or the prompt does not fit the frames.
        """
