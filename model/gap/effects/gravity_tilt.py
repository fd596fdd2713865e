"""Gravity that is not where the world frame says it is."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, vector
from model.gap.heading import turned_level
from model.gap.world import World
from model.simulator.forces.gravity import Gravity


class GravityTilt(Effect):
    """The direction of gravity differs from what was said, its size does not."""

    name = "gravity_tilt"
    source = Gravity.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "about_x": Quantity("rad", (-0.5, 0.5), 0.02),
        "about_y": Quantity("rad", (-0.5, 0.5), 0.02),
    }
    stacks: ClassVar[bool] = True
    absent: ClassVar[Mapping[str, float]] = {"about_x": 0.0, "about_y": 0.0}
    grid: ClassVar[Grid] = {"about_x": (-0.03, 0.03), "about_y": (-0.03, 0.03)}
    terms = (Gravity,)
    confused_with: ClassVar[Mapping[str, str]] = {"wind": "turn the set-up about the vertical"}

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return None if bool(world.gravity.any()) else "there is no gravity"

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Turn gravity about x, then about y."""
        x, y, z = world.gravity.to(values["about_x"]).unbind()
        sine, cosine = torch.sin(values["about_x"]), torch.cos(values["about_x"])
        y, z = cosine * y - sine * z, sine * y + cosine * z
        sine, cosine = torch.sin(values["about_y"]), torch.cos(values["about_y"])
        x, z = cosine * x + sine * z, -sine * x + cosine * z
        return world.with_force(Gravity(vector(x, y, z)))

    def turned(self, values: Mapping[str, float], angle: float) -> dict[str, float]:
        """About axes that are turned: exact for small tilts, whose order does not matter."""
        x, y = turned_level(np.array([values["about_x"], values["about_y"]]), angle)
        return {**values, "about_x": float(x), "about_y": float(y)}
