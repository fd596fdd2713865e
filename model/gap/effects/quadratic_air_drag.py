"""Air that resists fast motion more than in proportion."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, on_points
from model.gap.world import World
from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot, times
from model.simulator.parameters import Constant, TensorLike

SLOWEST = 1e-6
"""Speed [m/s] below which air does not resist; keeps the root differentiable."""


class AirDrag(StencilForce):
    r"""Drag with the square of the speed, $f_i = -c\,\lVert v_i\rVert\,v_i$.

    Args:
        stencils: The points that the air meets, shape [count, 1].
        coefficient: c [kg/m]: half of air density × drag coefficient × area of a point.

    Reference:
        Batchelor (1967), An introduction to fluid dynamics, section 5.11 (drag coefficient of a body).
    """

    name = "quadratic_air_drag"
    dissipative = True
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {"coefficient": Constant("kg/m", "stencils", (0.1, 5.0))}

    def __init__(self, stencils: Int[Tensor, "..."], coefficient: TensorLike) -> None:
        """See the class."""
        super().__init__(stencils, coefficient=coefficient)

    @staticmethod
    def law(velocities: tuple[Vector, ...], coefficient: Scalar) -> tuple[Vector, ...]:
        """Force [N] on the point."""
        own = velocities[0]
        speed = torch.sqrt(dot(own, own) + SLOWEST**2)
        return (times(-coefficient * speed, own),)


class QuadraticAirDrag(Effect):
    """Every point is slowed with the square of its speed, in proportion to its mass."""

    name = "quadratic_air_drag"
    source = AirDrag.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "drag_per_mass": Quantity("1/m", (0.005, 100.0), 0.5, log=True)
    }
    absent: ClassVar[Mapping[str, float]] = {"drag_per_mass": 0.0}
    grid: ClassVar[Grid] = {"drag_per_mass": (0.2, 1.5)}
    terms = (AirDrag,)
    confused_with: ClassVar[Mapping[str, str]] = {"wind": "hold it still for a second"}

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Put the object in air."""
        share = on_points(world, where) * mass_of(world)
        points = torch.arange(len(share)).unsqueeze(-1)
        return world.with_force(AirDrag(points, values["drag_per_mass"] * share.to(values["drag_per_mass"])))
