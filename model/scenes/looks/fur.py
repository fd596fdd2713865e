"""Fur and plush pile: hairs that stand out, each of its own shade."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import blend, noise
from model.types import Array


class Fur(Look):
    """A ragged outline, strands, and patches of a lighter or darker coat."""

    material: ClassVar[str] = "fur"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.44, 0.29, 0.18), (0.86, 0.78, 0.65), (0.50, 0.49, 0.48), (0.20, 0.15, 0.12), (0.74, 0.43, 0.20),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.0, gloss=0.0, sheen=0.25, wrap=0.4, pile=0.007)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Strand by strand; patches on every second piece."""
        dye = np.array(self.dye)
        other = 0.35 * dye + 0.6 if dye.mean() < 0.5 else 0.55 * dye
        patch = np.clip(4 * noise(place, 0.06, self.seed) - 0.8, 0, 1) * (self.pick(2) == 0)
        strand = 0.26 * noise(place, 0.0025, self.seed + 1) + 0.12 * noise(place, 0.008, self.seed + 2)
        return np.clip(blend(dye, other, patch) * (1 + strand)[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Tufts."""
        return 0.45 * np.stack([noise(place, 0.006, self.seed + axis) for axis in range(3)], axis=1)
