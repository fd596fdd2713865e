"""Gaussians → image: the seam every rasteriser fills."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor, nn

from model.types import Camera


@dataclass(frozen=True)
class Rendering:
    """What one camera sees."""

    color: Float[Tensor, "H W 3"]
    """Premultiplied by alpha: on black."""
    alpha: Float[Tensor, "H W"]
    depth: Float[Tensor, "H W"]
    """Alpha-weighted mean depth along the optical axis [m]; 0 where alpha is 0."""


class Renderer(nn.Module, ABC):
    """Rasterises Gaussians, differentiably in all of its tensor arguments."""

    name: ClassVar[str]

    @abstractmethod
    def forward(
        self,
        means: Float[Tensor, "G 3"],
        scales: Float[Tensor, "G 3"],
        quaternions: Float[Tensor, "G 4"],
        opacities: Float[Tensor, " G"],
        colors: Float[Tensor, "G 3"],
        camera: Camera,
    ) -> Rendering:
        """Render from `camera` at its own resolution."""
