"""A ground on which it takes more to start sliding than to go on."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int
from torch import Tensor

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, no_ground, on_points
from model.gap.world import World
from model.simulator.forces.base import Scalar
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector
from model.simulator.parameters import Constant, TensorLike

TURN = 0.02
"""Slip [m/s] at which the friction of a standing point has nearly its full size."""


class Stribeck(StencilForce):
    r"""Friction beyond Coulomb's that acts on slow contact, within a short height of the ground.

    $f_t = -F\,e^{-(u/u_s)^2}\tanh(u/u_0)\,v_t/u$ with $u = |v_t|$, times $e^{-(h/r)^2}$ at the height h.

    Args:
        stencils: The points that may stand on the ground, shape [count, 1].
        excess: F [N], what static friction has more than sliding friction.
        slip_speed: $u_s$ [m/s], beyond which only sliding friction is left.
        reach: Height [m] over which contact fades.
        height: z of the ground [m].

    Reference:
        Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), A survey of models, analysis tools and
        compensation methods for the control of machines with friction, Automatica 30, eq. 5 (Stribeck curve).
    """

    name = "static_friction"
    dissipative = True
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "excess": Constant("N", "stencils", (1.0, 20.0)),
        "slip_speed": Constant("m/s", "scene", (0.5, 2.0)),
        "reach": Constant("m", "scene", (0.05, 0.1)),
        "height": Constant("m", "scene", (-0.1, 0.0), positive=False),
    }

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        excess: TensorLike,
        slip_speed: TensorLike,
        reach: TensorLike,
        height: TensorLike,
    ) -> None:
        """See the class."""
        super().__init__(stencils, excess=excess, slip_speed=slip_speed, reach=reach, height=height)

    @staticmethod
    def law(
        positions: tuple[Vector, ...],
        velocities: tuple[Vector, ...],
        excess: Scalar,
        slip_speed: Scalar,
        reach: Scalar,
        height: Scalar,
    ) -> tuple[Vector, ...]:
        """Force [N] on the point."""
        x, y, _ = velocities[0]
        slip = torch.sqrt(x * x + y * y + 1e-12)
        contact = torch.exp(-((torch.relu(positions[0][2] - height) / reach) ** 2))
        size = excess * contact * torch.exp(-((slip / slip_speed) ** 2)) * torch.tanh(slip / TURN) / slip
        return ((-size * x, -size * y, 0.0 * x),)


class StaticFriction(Effect):
    """What stands on the ground starts to slide later than it stops."""

    name = "static_friction"
    source = Stribeck.__doc__ or ""
    acts = "ground"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "excess_per_mass": Quantity("m/s²", (0.1, 300.0), 5.0, log=True),
        "slip_speed": Quantity("m/s", (0.02, 1.0), 0.1, log=True),
    }
    absent: ClassVar[Mapping[str, float]] = {"excess_per_mass": 0.0}
    grid: ClassVar[Grid] = {"slip_speed": (0.05, 0.3)}
    terms = (Stribeck,)
    confused_with: ClassVar[Mapping[str, str]] = {"adhesion": "drag it slowly and fast, without lifting it"}

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_ground(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Make the ground rough for what stands still."""
        assert world.ground_height is not None
        share = on_points(world, where) * mass_of(world)
        points = torch.arange(share.shape[-1]).unsqueeze(-1)
        excess = values["excess_per_mass"] * share.to(values["excess_per_mass"])
        reach = 0.25 * world.spacing
        return world.with_force(Stribeck(points, excess, values["slip_speed"], reach, world.ground_height))
