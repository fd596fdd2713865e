"""Resistance to bending of a row of points that is curved at rest."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.bending import STRAIGHT, Bending
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, cross, dot, minus, plus, times
from model.simulator.parameters import TensorLike

FOLDED = 1e-2
"""How near to folded back a row is, at 172°, where its curvature is 28 and grows no further: what has a
thickness is not folded to a point. How near to turned round a chord is, where it takes a turn along no
further."""
NO_LENGTH = 1e-24
"""Of chords that have none, the product of their squares [m⁴]: those of a micrometre."""


class CurvedBending(StencilForce):
    r"""An elastic rod through three points in a row, the middle one second, curved at rest.

    $E = B\,|t - R\,t_0|^2/s$, with the curvature vector of the two pieces,
    $t = 2\,(e_0 \times e_1)/(|e_0||e_1| + e_0 \cdot e_1)$, up to where the row is nearly folded back
    (`FOLDED`), and that at rest, $t_0$, which turns with the chord (R, the least turn from where the chord
    was). It begins in the plane in which the row is bent at first: as `Bending` has it, which knows no
    direction, a rod that is curved at rest is as much at rest bent the other way.

    A turn of the row about its own chord leaves $t_0$ as it is, since points tell no such turn of what is
    straight: a bent row is held against it, by nothing, as if by a hand that does not let it twist. There is
    a torque about the chord then.

    Args:
        stencils: Points, shape [stencil_count, 3].
        bending_stiffness: B [N·m²].
        span: s, the length of both pieces together at rest [m].
        rest_turn: $|t_0|$ [1]; 0 is straight.

    Reference:
        Bergou et al. (2008), Discrete elastic rods, ACM Transactions on Graphics 27(3) (bending energy with
        the curvature binormal, parallel transport), for an isotropic cross section without twist.
    """

    name = "curved_bending"
    internal = True
    size = 3
    constants = Bending.constants
    memory: ClassVar[Mapping[str, float]] = dict.fromkeys(
        ("rest_x", "rest_y", "rest_z", "chord_x", "chord_y", "chord_z"), 0.0
    )

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
        positions: tuple[Vector, ...],
        bending_stiffness: Scalar,
        span: Scalar,
        rest_x: Scalar,
        rest_y: Scalar,
        rest_z: Scalar,
        chord_x: Scalar,
        chord_y: Scalar,
        chord_z: Scalar,
    ) -> Scalar:
        """Energy [J]."""
        rest = carried((rest_x, rest_y, rest_z), (chord_x, chord_y, chord_z), chord_of(positions))
        elastic = minus(turn_of(positions), rest)
        return bending_stiffness * dot(elastic, elastic) / span

    @staticmethod
    def after(
        positions: tuple[Vector, ...],
        rest_x: Scalar,
        rest_y: Scalar,
        rest_z: Scalar,
        chord_x: Scalar,
        chord_y: Scalar,
        chord_z: Scalar,
    ) -> tuple[Scalar, ...]:
        """The turn at rest, and the chord that it goes with."""
        now = chord_of(positions)
        return (*carried((rest_x, rest_y, rest_z), (chord_x, chord_y, chord_z), now), *now)

    @staticmethod
    def settled(positions: tuple[Vector, ...], rest_turn: Scalar) -> tuple[Scalar, ...]:
        """In the direction in which it is turned."""
        turn = turn_of(positions)
        size = torch.sqrt(dot(turn, turn) + STRAIGHT)
        return (*times(rest_turn / size, turn), *chord_of(positions))


def chord_of(positions: tuple[Vector, ...]) -> Vector:
    """From the first point to the last [m]."""
    return minus(positions[2], positions[0])


def turn_of(positions: tuple[Vector, ...]) -> Vector:
    """Twice the tangent of half the angle by which a row turns, along the axis of that [1]."""
    before, after = minus(positions[1], positions[0]), minus(positions[2], positions[1])
    whole = torch.sqrt(dot(before, before) * dot(after, after))
    along = torch.maximum(whole + dot(before, after), FOLDED * whole)
    return times(2.0 / along, cross(before, after))


def carried(turn: Vector, before: Vector, now: Vector) -> Vector:
    """A turn that goes with a chord from where it was, by the least rotation that takes it there."""
    whole = torch.sqrt(dot(before, before) * dot(now, now) + NO_LENGTH)
    across = times(1.0 / whole, cross(before, now))
    along = torch.maximum(whole + dot(before, now), FOLDED * whole)
    once = cross(across, turn)
    return plus(plus(turn, once), times(whole / along, cross(across, once)))
