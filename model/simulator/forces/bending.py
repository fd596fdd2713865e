"""Resistance of a row of points to bending."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, cross, dot, minus
from model.simulator.parameters import Constant, TensorLike

STRAIGHT = 1e-12
"""Square of the turn below which a row of points is straight."""
FOLDED = 1e-4
"""How near to folded back a row is, as a square, where its curvature grows no further: at 172°, to 28. What
has a thickness is not folded to a point."""


class Bending(StencilForce):
    r"""An elastic rod through three points in a row, the middle one second.

    $E = B\,(\kappa - \kappa_0)^2 / s$, with $\kappa = 2\tan(\theta/2)$ of the angle $\theta$ by which the row
    turns at its middle, up to where it is nearly folded back (`FOLDED`), and s the length of its two pieces
    together at rest. One that is curved at rest is as much at rest bent the other way, which a
    `CurvedBending`, that takes longer, is not.

    Args:
        stencils: Points, shape [stencil_count, 3].
        bending_stiffness: B [N·m²].
        span: s [m].
        rest_turn: $\kappa_0$ [1]; 0 is straight.

    Reference:
        Bergou et al. (2008), Discrete elastic rods, ACM Transactions on Graphics 27(3), section 4.2.2
        (bending energy with the curvature binormal), for an isotropic cross section and planar rest shape.
    """

    name = "bending"
    internal = central = True
    size = 3
    constants: ClassVar[Mapping[str, Constant]] = {
        "bending_stiffness": Constant("N*m^2", "stencils", (1e-3, 1.0)),
        "span": Constant("m", "stencils", (0.01, 0.1)),
        "rest_turn": Constant("1", "stencils", (0.0, 1.0)),
    }

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        bending_stiffness: TensorLike,
        span: TensorLike,
        rest_turn: TensorLike = 0.0,
    ) -> None:
        """See the class."""
        super().__init__(stencils, bending_stiffness=bending_stiffness, span=span, rest_turn=rest_turn)

    @staticmethod
    def potential(
        positions: tuple[Vector, ...], bending_stiffness: Scalar, span: Scalar, rest_turn: Scalar
    ) -> Scalar:
        """Energy [J]."""
        before, after = minus(positions[1], positions[0]), minus(positions[2], positions[1])
        turned = cross(before, after)
        whole = dot(before, before) * dot(after, after)
        along = torch.sqrt(whole) + dot(before, after)
        square = 4.0 * dot(turned, turned) / torch.maximum(along * along, FOLDED * whole)
        turn = torch.sqrt(square + STRAIGHT)
        return bending_stiffness * (turn - rest_turn) ** 2 / span
