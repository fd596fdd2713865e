"""Moulded plastic: one bright colour, and the window in it."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from model.scenes.looks.base import Color, Finish, Look
from model.types import Array


class Plastic(Look):
    """Even and shiny."""

    material: ClassVar[str] = "plastic"
    dyes: ClassVar[tuple[Color, ...]] = (
        (0.80, 0.06, 0.06), (0.92, 0.72, 0.04), (0.04, 0.22, 0.75), (0.06, 0.55, 0.20),
        (0.92, 0.40, 0.03), (0.86, 0.87, 0.88), (0.75, 0.10, 0.45),
    )  # fmt: skip
    finish: ClassVar[Finish] = Finish(specular=0.45, gloss=0.95)

    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """The dye."""
        return np.tile(np.array(self.dye), (len(place), 1))
