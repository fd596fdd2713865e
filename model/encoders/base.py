"""Pixels → features: the seam every semantic encoder fills."""

from abc import ABC, abstractmethod
from typing import ClassVar

from jaxtyping import Float32, UInt8
from torch import nn

from model.types import Array


class SemanticEncoder(nn.Module, ABC):
    """Dense features of one image."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None = None
    dim: int
    """Length of a feature vector."""

    @abstractmethod
    def forward(self, image: UInt8[Array, "H W 3"]) -> Float32[Array, "h w D"]:
        """Features on a regular grid over the whole image (cell centres evenly spaced)."""
