"""Resistance of a row of points to how fast it bends."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Float64, Int, Int64
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot, minus, plus, times
from model.simulator.parameters import Constant, TensorLike
from model.simulator.structure import rows, spans
from model.types import Array


class BendingDamping(StencilForce):
    r"""A viscous hinge in the middle of three points in a row, the middle one second.

    With the turn $b = 2\,(x_0 - 2 x_1 + x_2)/s$ and the chord $e = x_2 - x_0$, what is resisted is how fast
    the turn changes beside the chord's own turning $\omega = e \times \dot e/|e|^2$,
    $y = \dot b - \omega \times b$; forces follow from the dissipation $D\,|y|^2/2$. A turning of the row is
    not resisted, but for the little of a bent one about its chord.

    Args:
        stencils: Points, shape [stencil_count, 3].
        bending_damping: D [N·m·s].
        span: s, the length of both pieces together at rest [m].

    Reference:
        Goldstein, Poole and Safko (2002), Classical mechanics, third edition, section 1.5 (Rayleigh's
        dissipation function), for the second difference of the places, in a frame that turns with the chord.
    """

    name = "bending_damping"
    internal = dissipative = True
    size = 3
    constants: ClassVar[Mapping[str, Constant]] = {
        "bending_damping": Constant("N*m*s", "stencils", (1e-6, 1e-3)),
        "span": Constant("m", "stencils", (0.01, 0.1)),
    }

    def __init__(self, stencils: Int[Tensor, "..."], bending_damping: TensorLike, span: TensorLike) -> None:
        """See the class."""
        super().__init__(stencils, bending_damping=bending_damping, span=span)

    @staticmethod
    def law(
        positions: tuple[Vector, ...],
        velocities: tuple[Vector, ...],
        bending_damping: Scalar,
        span: Scalar,
    ) -> tuple[Vector, ...]:
        """Force on each point [N]."""
        turn, rate = (_bend(of, 2.0 / span) for of in (positions, velocities))
        chord, turning = (minus(of[2], of[0]) for of in (positions, velocities))
        square = dot(chord, chord)
        # ω × b, with ω = e × ė / |e|²
        carried = minus(times(dot(chord, turn) / square, turning), times(dot(turning, turn) / square, chord))
        resisted = minus(rate, carried)
        moment = times(-bending_damping, resisted)
        ends = times(2.0 / span, moment)
        along, across = dot(chord, turn) / square, dot(chord, moment) / square
        back = minus(times(along, moment), times(across, turn))
        return plus(ends, back), times(-2.0, ends), minus(ends, back)

    @classmethod
    def calming(
        cls, points: Float64[Array, "N 3"], springs: Int64[Array, "E 2"], mass: float, decay: TensorLike
    ) -> "BendingDamping":
        """For all rows of neighbours in a graph: waves of alternating neighbours die out at this rate.

        Dashpots act along springs, so nothing else resists such a zigzag, which pressing together sets off.
        Waves of n points die out at (π/n)⁴ of the rate: what is larger than a few points hardly feels it.

        Args:
            points: At rest [m].
            springs: Pairs of points.
            mass: Of all points [kg].
            decay: [1/s], a scalar or of shape [*b, 1].
        """
        triples = rows(points, springs)
        span = spans(points, triples)
        each = mass / len(points) / max(1.0, len(triples) / len(points))
        # of alternating points of mass m at distances h, with one row each, amplitudes fade at 16 D / (m h²)
        unit = torch.from_numpy(each / 16.0 * (0.5 * span) ** 2)
        return cls(torch.from_numpy(triples), torch.as_tensor(decay) * unit, span)


def _bend(row: tuple[Vector, ...], scale: Scalar) -> Vector:
    """Second difference of a row of three vectors, times a number."""
    return times(scale, minus(minus(row[2], row[1]), minus(row[1], row[0])))
