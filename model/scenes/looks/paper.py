"""Paper and cardboard: light, matt, creased into facets, sometimes printed."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import cells, directions, noise, stripes
from model.types import Array

FACET = 0.024
"""Between creases [m]."""
LINE = 0.0075
"""Between printed lines [m]."""


class Paper(Look):
    """Facets with sharp creases between them; lines of print on every second piece."""

    material: ClassVar[str] = "paper"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.93, 0.92, 0.89), (0.90, 0.90, 0.91), (0.74, 0.60, 0.44), (0.85, 0.83, 0.77),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.02, gloss=0.1)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The sheet, greyer along its creases, and words."""
        border, _ = cells(place, FACET, self.seed)
        shade = 1 - 0.16 * np.exp(-border / 0.05) + 0.015 * noise(place, 0.004, self.seed)
        if self.pick(2) == 0:
            line = stripes(place[:, 1] + place[:, 2], LINE, 0.3)
            words = np.clip(3 * noise(place * [1.0, 0.3, 0.3], 0.006, self.seed + 1) + 0.6, 0, 1)
            shade = shade * (1 - 0.4 * line * words)
        return np.clip(np.array(self.dye) * shade[:, None], 0, 1)

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Each facet is tilted its own way."""
        _, cell = cells(place, FACET, self.seed)
        return 0.45 * directions(cell, self.seed)
