"""Denim: indigo twill with white weft, faded, with orange seams."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import blend, noise, stripes
from model.types import Array

TWILL = 0.0055
"""Between diagonals [m]: coarser than real ones, so that a camera sees them."""
SEAM = 0.085
"""Between seams [m]."""
WEFT, THREAD = np.array([0.72, 0.76, 0.80]), np.array([0.80, 0.45, 0.12])


class Denim(Look):
    """Diagonals, flecks, worn patches, double seams."""

    material: ClassVar[str] = "denim"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.12, 0.19, 0.36), (0.20, 0.31, 0.50), (0.07, 0.11, 0.22), (0.30, 0.42, 0.60),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.02, gloss=0.0, wrap=0.15)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Indigo, the white that shows along the diagonals and where it is worn, and stitches."""
        x, y, z = place.T
        twill = stripes(x + y + z, TWILL * np.sqrt(2), 0.35)
        fleck = np.clip(noise(place, 0.0025, self.seed), 0, 1)
        worn = np.clip(0.5 * noise(place, 0.06, self.seed + 1), 0, 0.35)
        cloth = blend(np.array(self.dye), WEFT, np.clip(0.38 * twill + 0.30 * fleck + worn, 0, 1))
        return blend(cloth, THREAD, self._stitches(x, y))

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Stiff folds."""
        return 0.14 * np.stack([noise(place, 0.03, self.seed + axis) for axis in range(3)], axis=1)

    def _stitches(self, x: Float64[Array, " P"], y: Float64[Array, " P"]) -> Float64[Array, " P"]:
        off = (y + 0.3 * SEAM) % SEAM - SEAM / 2
        row = np.maximum(np.abs(off - 0.004) < 0.0016, np.abs(off + 0.004) < 0.0016)
        return np.asarray(row * stripes(x, 0.009, 0.7), np.float64)
