"""Woven cotton and felt: plain, striped, checked or dotted."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.scenes.looks.pattern import blend, noise, stripes
from model.types import Array

THREAD = 0.0045
"""Period of the weave [m]: coarser than cotton's, so that a camera sees it."""


class Fabric(Look):
    """Matt, in cheerful colours, with a printed or woven design."""

    material: ClassVar[str] = "fabric"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.78, 0.30, 0.28), (0.25, 0.52, 0.50), (0.85, 0.66, 0.30), (0.45, 0.56, 0.30),
        (0.62, 0.40, 0.60), (0.80, 0.74, 0.62), (0.30, 0.42, 0.66), (0.86, 0.52, 0.42),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.02, gloss=0.0, sheen=0.08, wrap=0.25)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The design in the dye and a light colour, and the weave over it."""
        x, y, z = place.T
        light = np.array([0.90, 0.87, 0.80])
        period = (0.022, 0.030, 0.038)[self.pick(3, 1)]
        design = (
            np.zeros(len(place)),
            stripes(x + 0.1 * z, period),
            0.5 * (stripes(x, period) + stripes(y + z, period)),
            stripes(x, period, 0.6) * stripes(y + 0.5 * z, period, 0.6) * stripes(z, 3 * period, 0.8),
        )[self.pick(4)]
        colored = blend(np.array(self.dye), light, design)
        weave = np.sin(2 * np.pi * x / THREAD) * np.sin(2 * np.pi * (y + z) / THREAD)
        grain = 0.09 * weave + 0.06 * noise(place, 0.0022, self.seed) + 0.04 * noise(place, 0.03, self.seed)
        woven: Float64[Array, "P 3"] = np.clip(colored * (1 + grain)[:, None], 0, 1)
        return woven

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """Slack in the cloth."""
        return 0.12 * np.stack([noise(place, 0.025, self.seed + axis) for axis in range(3)], axis=1)
