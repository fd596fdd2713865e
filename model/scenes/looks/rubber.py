"""Rubber: dark and even, with moulded ribs and a wide, weak gloss."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import noise
from model.types import Array

RIB = 0.011
"""From rib to rib [m]."""


class Rubber(Look):
    """One colour all over; a dusty bloom in the grooves between the ribs."""

    material: ClassVar[str] = "rubber"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.10, 0.10, 0.11), (0.16, 0.17, 0.19), (0.42, 0.13, 0.10), (0.12, 0.22, 0.18), (0.10, 0.10, 0.10),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.16, gloss=0.15)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The dye, and the bloom."""
        groove = 0.5 - 0.5 * np.cos(2 * np.pi * place[:, 0] / RIB)
        dusty = 0.05 * groove**4 + 0.012 * noise(place, 0.02, self.seed)
        return np.clip(np.array(self.dye) + dusty[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Ribs across the first axis."""
        slope = 0.45 * np.sin(2 * np.pi * place[:, 0] / RIB)
        return np.stack([slope, np.zeros_like(slope), np.zeros_like(slope)], axis=1)
