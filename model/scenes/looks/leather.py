"""Tanned skin: brown to black, grained, with a dull gloss."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import cells, noise
from model.types import Array

GRAIN = 0.007
"""Size of a pebble of the grain [m]."""


class Leather(Look):
    """Pebbles with dark creases between them, and blotches from wear."""

    material: ClassVar[str] = "leather"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.50, 0.29, 0.15), (0.30, 0.17, 0.10), (0.12, 0.10, 0.09), (0.55, 0.28, 0.12), (0.36, 0.11, 0.09),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.22, gloss=0.35)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The dye, darker in the creases, lighter where it is worn."""
        border, _ = cells(place, GRAIN, self.seed)
        crease = np.exp(-border / 0.10)
        worn = 0.16 * noise(place, 0.045, self.seed) + 0.08 * noise(place, 0.012, self.seed + 1)
        return np.clip(np.array(self.dye) * ((1 + worn) * (1 - 0.5 * crease))[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Pebbles and folds."""
        fine = np.stack([noise(place, 0.6 * GRAIN, self.seed + axis) for axis in range(3)], axis=1)
        folds = np.stack([noise(place, 0.03, self.seed + 5 + axis) for axis in range(3)], axis=1)
        return 0.30 * fine + 0.15 * folds
