"""Brushed metal: mirrors the room, in its own tint."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import noise
from model.types import Array


class Metal(Look):
    """Fine scratches along the first axis."""

    material: ClassVar[str] = "metal"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.70, 0.71, 0.73), (0.56, 0.58, 0.61), (0.78, 0.62, 0.32), (0.76, 0.48, 0.36),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.9, gloss=0.8, metallic=True)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The tint, brighter and darker along the scratches."""
        scratch = noise(place * [0.04, 1.0, 1.0], 0.0025, self.seed)
        return np.clip(np.array(self.dye) * (1 + 0.10 * scratch)[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Scratches, and dents that bend what is mirrored."""
        scratch = 0.05 * noise(place * [0.04, 1.0, 1.0], 0.0025, self.seed + 1)
        dents = np.stack([noise(place, 0.05, self.seed + 2 + axis) for axis in range(3)], axis=1)
        return 0.15 * dents + scratch[:, None] * [0.0, 1.0, 1.0]
