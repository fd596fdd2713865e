"""A body that is heavier in one place."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, on_points, vector
from model.gap.heading import from_axes, heading, turned_level
from model.gap.world import World
from model.types import Array


class MassHeterogeneity(Effect):
    """Points near a centre have more mass than was assumed, fading as a Gaussian of the distance at rest."""

    name = "mass_heterogeneity"
    source = r"""Mass of a point, $m_i\,(1 + \delta\,e^{-r_i^2 / 2\sigma^2})$; with its inertia and weight.

    Reference:
        Newton (1687), Philosophiae naturalis principia mathematica, law 2 and book 3, proposition 6.
    """
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "excess": Quantity("1", (0.02, 50.0), 1.0, log=True),
        "x": Quantity("1", (-0.1, 1.1), 0.5),
        "y": Quantity("1", (-0.1, 1.1), 0.5),
        "z": Quantity("1", (-0.1, 1.1), 0.5),
        "radius": Quantity("1", (0.05, 0.5), 0.25, log=True),
    }
    stacks: ClassVar[bool] = True
    absent: ClassVar[Mapping[str, float]] = {"excess": 0.0}
    grid: ClassVar[Grid] = {"x": (0.15, 0.85), "y": (0.15, 0.85), "z": (0.15, 0.85)}
    confused_with: ClassVar[Mapping[str, str]] = {
        "wind": "shake it",
        "gravity_tilt": "shake it",
        "anisotropy": "shake it, and hold it still",
    }

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Load the points around the centre; x, y, z are shares of an upright box around the rest shape.

        The box lies along the body; its sides are called after the axes that they are nearest to.
        """
        more = values["excess"] * self._near(world, values, where)
        mass = mass_of(world).to(more) * (1.0 + more)
        return world.with_system(world.system.with_values(mass=mass))

    def strength(self, world: World, values: Values, where: Field | None = None) -> Field:
        """Where the load is."""
        return self._near(world, values, where).detach().to(torch.float64)

    def _near(self, world: World, values: Values, where: Field | None) -> Float[Tensor, "*b P"]:
        points = _in_own_box(world.system.points.double().numpy()).to(values["x"])
        low, high = points.amin(0), points.amax(0)
        size = (high - low).norm()
        centre = low + (high - low) * vector(values["x"], values["y"], values["z"])
        apart = ((points - centre.unsqueeze(-2)) ** 2).sum(-1) / (values["radius"] * size) ** 2
        return torch.exp(-0.5 * apart) * on_points(world, where).to(apart)


def _in_own_box(points: Float64[Array, "P 3"]) -> Float[Tensor, "P 3"]:
    """Places [m] in axes that are turned about the vertical until they lie along the body."""
    level = turned_level(points[:, :2], -from_axes(heading(points)))
    return torch.from_numpy(np.concatenate([level, points[:, 2:]], axis=1))
