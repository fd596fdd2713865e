"""Air that moves."""

from collections.abc import Mapping
from functools import partial
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor

from model.gap.effects.air import has_faces, in_air, of_face, on_face, on_point
from model.gap.effects.base import Effect, Field, Grid, Quantity, Values
from model.gap.heading import turned_level
from model.gap.world import World
from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, minus
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
    steady = True
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
        return on_point(minus((x, y, z), velocities[0]), coefficient)


class WindOnFaces(StencilForce):
    r"""Air at one velocity on the faces of a sheet, $F = c\lVert u\rVert((1-\varphi)u + \varphi(u\cdot n)n)$.

    With u = w - v, w the air's velocity, v that of a face's middle and n its normal; a third of it on
    each corner.

    Args:
        stencils: The corners of the faces, shape [count, 3].
        coefficient: c [kg/m]: half of air density × drag coefficient × area of a face.
        facing: φ [1], 0..1: the share that presses along the normal alone.
        x: Velocity of the air along x [m/s].
        y: Velocity of the air along y [m/s].
        z: Velocity of the air along z [m/s].

    Reference:
        Ling, Damodaran and Gay (1996), Aerodynamic force models for animating cloth motion in an air flow,
        The visual computer 12 (drag along and across the normal of each polygon).
    """

    name = "wind_on_faces"
    steady = True
    size = 3
    constants: ClassVar[Mapping[str, Constant]] = {
        "coefficient": Constant("kg/m", "stencils", (0.1, 5.0)),
        "facing": Constant("1", "scene", (0.0, 1.0)),
        **{axis: Constant("m/s", "scene", (-5.0, 5.0), positive=False) for axis in "xyz"},
    }

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        coefficient: TensorLike,
        facing: TensorLike,
        x: TensorLike,
        y: TensorLike,
        z: TensorLike = 0.0,
    ) -> None:
        """See the class."""
        super().__init__(stencils, coefficient=coefficient, facing=facing, x=x, y=y, z=z)

    @staticmethod
    def law(
        positions: tuple[Vector, ...],
        velocities: tuple[Vector, ...],
        coefficient: Scalar,
        facing: Scalar,
        x: Scalar,
        y: Scalar,
        z: Scalar,
    ) -> tuple[Vector, ...]:
        """Force [N] on each corner."""
        return on_face(positions, minus((x, y, z), of_face(velocities)), coefficient, facing)


class SteadyWind(Effect):
    """Air moves level, at one velocity, and pulls every point in proportion to its mass; a sheet facewise."""

    name = "wind"
    source = WindOnFaces.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "drag_per_mass": Quantity("1/m", (0.02, 100.0), 0.5, log=True),
        "x": Quantity("m/s", (-8.0, 8.0), 0.5),
        "y": Quantity("m/s", (-8.0, 8.0), 0.5),
        "facing": Quantity("1", (0.0, 1.0), 0.9),
    }
    absent: ClassVar[Mapping[str, float]] = {"drag_per_mass": 0.0}
    before: ClassVar[Mapping[str, float]] = {"facing": 0.0}
    grid: ClassVar[Grid] = {"x": (-1.0, 1.0), "y": (-1.0, 1.0)}
    terms = (Wind, WindOnFaces)
    confused_with: ClassVar[Mapping[str, str]] = {
        "gravity_tilt": "turn the set-up about the vertical, or move fast with and against it",
        "quadratic_air_drag": "hold it still for a second",
    }

    def within(self, world: World) -> Effect:
        """What is no sheet is met from all sides alike."""
        return self if has_faces(world) else WindFromAllSides()

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let it blow."""
        blown = {axis: values[axis] for axis in "xy"}
        points, faces = partial(Wind, **blown), partial(WindOnFaces, facing=values["facing"], **blown)
        return in_air(world, values["drag_per_mass"], where, points, faces)

    def turned(self, values: Mapping[str, float], angle: float) -> dict[str, float]:
        """It blows another way."""
        x, y = turned_level(np.array([values["x"], values["y"]]), angle)
        return {**values, "x": float(x), "y": float(y)}


class WindFromAllSides(SteadyWind):
    """The same of what is no sheet."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        name: quantity for name, quantity in SteadyWind.quantities.items() if name != "facing"
    }
    before: ClassVar[Mapping[str, float]] = {}

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let it blow."""
        return super().apply(world, {**values, "facing": torch.zeros(())}, where)
