"""Wood, cut from a log: rings, grain, and pores along them."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import blend, noise
from model.types import Array

RING = 0.009
"""Between rings [m]."""


class Wood(Look):
    """Rings around an axis near the first, oiled."""

    material: ClassVar[str] = "wood"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.78, 0.60, 0.38), (0.64, 0.46, 0.27), (0.42, 0.27, 0.16), (0.76, 0.57, 0.42),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.05, gloss=0.4)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Light early wood that darkens to the end of each ring, then a fresh one."""
        x, y, z = place.T
        wavy = 0.012 * noise(place * [0.25, 1.0, 1.0], 0.04, self.seed)
        radius = np.hypot(y - 0.05 + 0.08 * x, z + 0.07) + wavy
        ring = (radius / RING) % 1.0
        late = np.clip(ring, 0, 1) ** 2 * np.clip((1 - ring) / 0.12, 0, 1)
        pores = noise(place * [0.06, 1.0, 1.0], 0.0025, self.seed + 1)
        dye = np.array(self.dye)
        colored = blend(dye, dye * [0.52, 0.45, 0.38], late)
        return np.clip(colored * (1 + 0.10 * pores)[:, None], 0, 1)
