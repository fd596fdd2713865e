"""Air that resists fast motion more than in proportion."""

from collections.abc import Mapping
from functools import partial
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.gap.effects.air import has_faces, in_air, of_face, on_face, on_point
from model.gap.effects.base import Effect, Field, Grid, Quantity, Values
from model.gap.world import World
from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, times
from model.simulator.parameters import Constant, TensorLike


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
        return on_point(times(-1.0, velocities[0]), coefficient)


class AirDragOnFaces(StencilForce):
    r"""Drag on the faces of a sheet, $F = -c\,\lVert v\rVert\,((1-\varphi)\,v + \varphi\,(v\cdot n)\,n)$.

    With v the velocity of a face's middle and n its normal; a third of it on each corner.

    Args:
        stencils: The corners of the faces, shape [count, 3].
        coefficient: c [kg/m]: half of air density × drag coefficient × area of a face.
        facing: φ [1], 0..1: the share that presses along the normal alone.

    Reference:
        Ling, Damodaran and Gay (1996), Aerodynamic force models for animating cloth motion in an air flow,
        The visual computer 12 (drag along and across the normal of each polygon).
    """

    name = "quadratic_air_drag_on_faces"
    dissipative = True
    size = 3
    constants: ClassVar[Mapping[str, Constant]] = {
        "coefficient": Constant("kg/m", "stencils", (0.1, 5.0)),
        "facing": Constant("1", "scene", (0.0, 1.0)),
    }

    def __init__(self, stencils: Int[Tensor, "..."], coefficient: TensorLike, facing: TensorLike) -> None:
        """See the class."""
        super().__init__(stencils, coefficient=coefficient, facing=facing)

    @staticmethod
    def law(
        positions: tuple[Vector, ...], velocities: tuple[Vector, ...], coefficient: Scalar, facing: Scalar
    ) -> tuple[Vector, ...]:
        """Force [N] on each corner."""
        return on_face(positions, times(-1.0, of_face(velocities)), coefficient, facing)


class QuadraticAirDrag(Effect):
    """Air slows every point with the square of its speed, in proportion to its mass; a sheet facewise."""

    name = "quadratic_air_drag"
    source = AirDragOnFaces.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "drag_per_mass": Quantity("1/m", (0.005, 100.0), 0.5, log=True),
        "facing": Quantity("1", (0.0, 1.0), 0.9),
    }
    absent: ClassVar[Mapping[str, float]] = {"drag_per_mass": 0.0}
    before: ClassVar[Mapping[str, float]] = {"facing": 0.0}
    grid: ClassVar[Grid] = {"drag_per_mass": (0.2, 1.5)}
    terms = (AirDrag, AirDragOnFaces)
    confused_with: ClassVar[Mapping[str, str]] = {"wind": "hold it still for a second"}

    def within(self, world: World) -> Effect:
        """What is no sheet is met from all sides alike."""
        return self if has_faces(world) else DragFromAllSides()

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Put the object in air."""
        faces = partial(AirDragOnFaces, facing=values["facing"])
        return in_air(world, values["drag_per_mass"], where, AirDrag, faces)


class DragFromAllSides(QuadraticAirDrag):
    """The same of what is no sheet."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        name: quantity for name, quantity in QuadraticAirDrag.quantities.items() if name != "facing"
    }
    before: ClassVar[Mapping[str, float]] = {}

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Put the object in air."""
        return super().apply(world, {**values, "facing": torch.zeros(())}, where)
