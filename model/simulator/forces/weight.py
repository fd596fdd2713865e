"""A weight of its own for every point."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Int
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot
from model.simulator.parameters import Constant, TensorLike


class Weight(StencilForce):
    r"""A constant force on each point, $f_i = w_i$: gravity where it differs from point to point.

    Args:
        stencils: The points, shape [count, 1].
        x: Its component along x [N], shape [count].
        y: Along y.
        z: Along z.

    Reference:
        Newton (1687), Philosophiae naturalis principia mathematica, book 3, proposition 6 (weight is
        proportional to mass).
    """

    name = "weight"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        axis: Constant("N", "stencils", (-1.0, 1.0), positive=False) for axis in "xyz"
    }

    def __init__(self, stencils: Int[Tensor, "..."], x: TensorLike, y: TensorLike, z: TensorLike) -> None:
        """See the class."""
        super().__init__(stencils, x=x, y=y, z=z)

    @staticmethod
    def potential(positions: tuple[Vector, ...], x: Scalar, y: Scalar, z: Scalar) -> Scalar:
        """Energy [J], zero at the origin."""
        return -dot((x, y, z), positions[0])
