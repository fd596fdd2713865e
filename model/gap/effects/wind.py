"""Air that moves."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, on_points
from model.gap.effects.quadratic_air_drag import SLOWEST
from model.gap.heading import turned_level
from model.gap.world import World
from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot, minus, times
from model.simulator.parameters import Constant, TensorLike


class Wind(StencilForce):
    r"""Air at one velocity w: $f_i = c\,\lVert w - v_i\rVert\,(w - v_i)$.

    Args:
        stencils: The points that the air meets, shape [count, 1].
        coefficient: c [kg/m]: half of air density × drag coefficient × area of a point.
        x: Velocity of the air along x [m/s].
        y: Velocity of the air along y [m/s].
        z: Velocity of the air along z [m/s].

    Reference:
        Batchelor (1967), An introduction to fluid dynamics, section 5.11 (drag coefficient of a body).
    """

    name = "wind"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "coefficient": Constant("kg/m", "stencils", (0.1, 5.0)),
        **{axis: Constant("m/s", "scene", (-5.0, 5.0), positive=False) for axis in "xyz"},
    }

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        coefficient: TensorLike,
        x: TensorLike,
        y: TensorLike,
        z: TensorLike = 0.0,
    ) -> None:
        """See the class."""
        super().__init__(stencils, coefficient=coefficient, x=x, y=y, z=z)

    @staticmethod
    def law(
        velocities: tuple[Vector, ...], coefficient: Scalar, x: Scalar, y: Scalar, z: Scalar
    ) -> tuple[Vector, ...]:
        """Force [N] on the point."""
        seen = minus((x, y, z), velocities[0])
        speed = torch.sqrt(dot(seen, seen) + SLOWEST**2)
        return (times(coefficient * speed, seen),)


class SteadyWind(Effect):
    """The air moves level, at one velocity; it pulls every point in proportion to its mass."""

    name = "wind"
    source = Wind.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "drag_per_mass": Quantity("1/m", (0.02, 100.0), 0.5, log=True),
        "x": Quantity("m/s", (-8.0, 8.0), 0.5),
        "y": Quantity("m/s", (-8.0, 8.0), 0.5),
    }
    absent: ClassVar[Mapping[str, float]] = {"drag_per_mass": 0.0}
    grid: ClassVar[Grid] = {"x": (-1.0, 1.0), "y": (-1.0, 1.0)}
    terms = (Wind,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "gravity_tilt": "turn the set-up about the vertical, or move fast with and against it",
        "quadratic_air_drag": "hold it still for a second",
    }

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let it blow."""
        share = on_points(world, where) * mass_of(world)
        points = torch.arange(len(share)).unsqueeze(-1)
        coefficient = values["drag_per_mass"] * share.to(values["drag_per_mass"])
        return world.with_force(Wind(points, coefficient, values["x"], values["y"]))

    def turned(self, values: Mapping[str, float], angle: float) -> dict[str, float]:
        """It blows another way."""
        x, y = turned_level(np.array([values["x"], values["y"]]), angle)
        return {**values, "x": float(x), "y": float(y)}
