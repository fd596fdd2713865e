"""A ground that holds what leaves it."""

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


class Adhesion(StencilForce):
    r"""A pull towards the ground that acts near it, $f_z = -F\,s\,e^{1 - s}$ with $s = c + \max(h, 0)/r$.

    Of the height h above the ground. With c = 0 nothing pulls at what lies on the ground, only at what has
    left it; with c = 1 the pull is largest in contact, which bears it: what is pressed down so is harder to
    slide as well, as far as there is friction. What it takes to tear a point off is
    $F\,r\,(1 + c)\,e^{1 - c}$.

    Args:
        stencils: The points that may stick, shape [count, 1].
        pull: F [N], the largest pull.
        reach: r [m] over which it fades.
        at_contact: c [1], 0..1.
        height: z of the ground [m].

    Reference:
        Maugis (1992), Adhesion of spheres: the JKR-DMT transition using a Dugdale model, Journal of colloid
        and interface science 150 (a pull over a short reach with a given work), in a smooth form; Derjaguin,
        Muller and Toporov (1975), Effect of contact deformations on the adhesion of particles, Journal of
        colloid and interface science 53 (a load in contact, as with c = 1).
    """

    name = "adhesion"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "pull": Constant("N", "stencils", (1.0, 20.0)),
        "reach": Constant("m", "scene", (0.02, 0.05)),
        "at_contact": Constant("1", "scene", (0.0, 1.0)),
        "height": Constant("m", "scene", (-0.2, -0.1), positive=False),
    }

    def __init__(
        self,
        stencils: Int[Tensor, "..."],
        pull: TensorLike,
        reach: TensorLike,
        at_contact: TensorLike,
        height: TensorLike,
    ) -> None:
        """See the class."""
        super().__init__(stencils, pull=pull, reach=reach, at_contact=at_contact, height=height)

    @staticmethod
    def potential(
        positions: tuple[Vector, ...], pull: Scalar, reach: Scalar, at_contact: Scalar, height: Scalar
    ) -> Scalar:
        """Energy [J]; below the ground the pull is that of contact."""
        above = positions[0][2] - height
        scaled = at_contact + torch.relu(above) / reach
        below = at_contact * torch.exp(1.0 - at_contact) * torch.clamp(above, max=0.0)
        return pull * (below - reach * (scaled + 1.0) * torch.exp(1.0 - scaled))


class GroundAdhesion(Effect):
    """The ground pulls at points that lie on it or leave it."""

    name = "adhesion"
    source = Adhesion.__doc__ or ""
    acts = "ground"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "pull_per_mass": Quantity("m/s²", (0.1, 3000.0), 10.0, log=True),
        "reach": Quantity("m", (0.001, 0.03), 0.005, log=True),
        "at_contact": Quantity("1", (0.0, 1.0), 0.5),
    }
    absent: ClassVar[Mapping[str, float]] = {"pull_per_mass": 0.0}
    before: ClassVar[Mapping[str, float]] = {"at_contact": 0.0}
    grid: ClassVar[Grid] = {"reach": (0.002, 0.01), "at_contact": (0.0, 1.0)}
    terms = (Adhesion,)
    confused_with: ClassVar[Mapping[str, str]] = {"static_friction": "lift it straight up"}

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_ground(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Make the ground sticky."""
        assert world.ground_height is not None
        share = on_points(world, where) * mass_of(world)
        points = torch.arange(share.shape[-1]).unsqueeze(-1)
        pull = values["pull_per_mass"] * share.to(values["pull_per_mass"])
        return world.with_force(
            Adhesion(points, pull, values["reach"], values["at_contact"], world.ground_height)
        )
