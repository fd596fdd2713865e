"""Rows of points that keep a bend."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.bending import STRAIGHT
from model.simulator.forces.curved_bending import CurvedBending, chord_of, turn_of
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot, minus, plus, times
from model.simulator.parameters import Constant, TensorLike


class PlasticBending(StencilForce):
    r"""A rod whose turn at rest flows: $\dot t_0 = r\,(1 - t_y/|e|)\,e$ where $|e| > t_y$, $e = t - R\,t_0$.

    Otherwise as `CurvedBending`. It pulls at nothing where it has long been.

    Args:
        stencils: Points, shape [stencil_count, 3].
        bending_stiffness: B [N·m²].
        span: s, the length of both pieces together at rest [m].
        yield_turn: $t_y$ [1].
        flow_rate: r [1/s].

    Reference:
        Bergou et al. (2010), Discrete viscous threads, ACM Transactions on Graphics 29(4) (rest curvatures
        that flow); Perzyna (1966), Fundamental problems in viscoplasticity, Advances in applied mechanics 9
        (overstress flow).
    """

    name = "plastic_bending"
    internal = True
    size = 3
    constants: ClassVar[Mapping[str, Constant]] = {
        "bending_stiffness": Constant("N*m^2", "stencils", (1e-3, 1.0)),
        "span": Constant("m", "stencils", (0.01, 0.1)),
        "yield_turn": Constant("1", "stencils", (0.01, 0.5)),
        "flow_rate": Constant("1/s", "scene", (0.0, 100.0)),
    }
    memory = CurvedBending.memory
    potential = CurvedBending.potential

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        bending_stiffness: TensorLike,
        span: TensorLike,
        yield_turn: TensorLike,
        flow_rate: TensorLike,
    ) -> None:
        """See the class."""
        super().__init__(
            stencils,
            bending_stiffness=bending_stiffness,
            span=span,
            yield_turn=yield_turn,
            flow_rate=flow_rate,
        )

    @staticmethod
    def after(
        positions: tuple[Vector, ...],
        yield_turn: Scalar,
        flow_rate: Scalar,
        rest_x: Scalar,
        rest_y: Scalar,
        rest_z: Scalar,
        chord_x: Scalar,
        chord_y: Scalar,
        chord_z: Scalar,
        dt: Scalar,
    ) -> tuple[Scalar, ...]:
        """The turn at rest, and the chord that it goes with."""
        moved = CurvedBending.after(positions, rest_x, rest_y, rest_z, chord_x, chord_y, chord_z)
        rest, chord = moved[:3], moved[3:]
        elastic = minus(turn_of(positions), rest)
        size = torch.sqrt(dot(elastic, elastic) + STRAIGHT)
        flowed = (1.0 - torch.exp(-flow_rate * dt)) * torch.relu(size - yield_turn) / size
        return (*plus(rest, times(flowed, elastic)), *chord)

    @staticmethod
    def settled(positions: tuple[Vector, ...]) -> tuple[Scalar, ...]:
        """All of the turn that there is."""
        return (*turn_of(positions), *chord_of(positions))
