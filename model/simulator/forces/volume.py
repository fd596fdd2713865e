"""Resistance of a body to changes of its volume."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Int
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, cross, dot, minus
from model.simulator.parameters import Constant, TensorLike


class Volume(StencilForce):
    r"""A tetrahedron that keeps its volume.

    $E = \tfrac{K}{2}\,(V - V_0)^2 / V_0$, with $V = (x_1-x_0)\cdot\big((x_2-x_0)\times(x_3-x_0)\big)/6$.

    Args:
        stencils: Points, shape [stencil_count, 4], in the order in which V is positive.
        bulk_modulus: K [N/m²].
        rest_volume: $V_0$ [m³].

    Reference:
        Teschner, Heidelberger, Mueller and Gross (2004), A versatile and robust model for geometrically
        complex deformable solids, Computer Graphics International, section 3 (energy of a tetrahedron's
        volume), with the stiffness written as a bulk modulus.
    """

    name = "volume"
    internal = central = True
    size = 4
    constants: ClassVar[Mapping[str, Constant]] = {
        "bulk_modulus": Constant("N/m^2", "stencils", (1e3, 1e6)),
        "rest_volume": Constant("m³", "stencils", (1e-6, 1e-3)),
    }

    def __init__(
        self, stencils: Int[Tensor, "..."], bulk_modulus: TensorLike, rest_volume: TensorLike
    ) -> None:
        """See the class."""
        super().__init__(stencils, bulk_modulus=bulk_modulus, rest_volume=rest_volume)

    @staticmethod
    def potential(positions: tuple[Vector, ...], bulk_modulus: Scalar, rest_volume: Scalar) -> Scalar:
        """Energy [J]."""
        first, second, third = (minus(corner, positions[0]) for corner in positions[1:])
        change = dot(first, cross(second, third)) / 6.0 - rest_volume
        return 0.5 * bulk_modulus * change**2 / rest_volume
