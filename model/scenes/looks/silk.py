"""Silk and satin: jewel colours that shimmer along soft folds."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import noise
from model.types import Array


class Silk(Look):
    """Without texture; the gloss is all."""

    material: ClassVar[str] = "silk"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.62, 0.06, 0.20), (0.08, 0.40, 0.46), (0.46, 0.22, 0.56), (0.78, 0.60, 0.26),
        (0.84, 0.72, 0.72), (0.08, 0.14, 0.46),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.42, gloss=0.45, sheen=0.35)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The dye, a little deeper here than there."""
        return np.clip(np.array(self.dye) * (1 + 0.05 * noise(place, 0.05, self.seed))[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Folds that run along the first axis."""
        across = noise(place * [0.3, 1.0, 1.0], 0.022, self.seed + 1)
        upward = noise(place * [0.3, 1.0, 1.0], 0.022, self.seed + 2)
        return 0.55 * np.stack([0.2 * across, across, upward], axis=1)
