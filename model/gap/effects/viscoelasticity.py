"""A material whose stress relaxes."""

from collections.abc import Mapping
from typing import ClassVar

import torch

from model.gap.effects.base import (
    Effect,
    Field,
    Grid,
    Quantity,
    Values,
    borne,
    no_springs,
    on_springs,
    slackness_of,
    spring_stiffness,
)
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike


class MaxwellBranch(AxialForce):
    r"""A Maxwell element beside each spring, a strain z of which relaxes.

    $f = k\,\alpha\,L\,e$ with $\dot z = e/\tau$ and $e = \varepsilon - z$, of the strain
    $\varepsilon = |d|/L - 1$. Of an e below zero a spring that goes slack bears, and feels, $1 - \beta$.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        share: How strongly it acts on each spring [1], shape [spring_count].
        branch: $\alpha$ [1]: stiffness of the branch over that of the spring.
        relaxation_time: $\tau$ [s].
        slackness: $\beta$ [1], shape [spring_count].

    Reference:
        Zener (1948), Elasticity and anelasticity of metals (the standard linear solid).
    """

    name = "viscoelasticity"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "share": Constant("1", "springs", (0.0, 1.0)),
        "branch": Constant("1", "scene", (0.0, 3.0)),
        "relaxation_time": Constant("s", "scene", (0.05, 1.0)),
        "slackness": Constant("1", "springs", (0.0, 1.0)),
    }
    memory: ClassVar[Mapping[str, float]] = {"viscous_strain": 0.0}

    def __init__(
        self,
        stiffness: TensorLike,
        share: TensorLike,
        branch: TensorLike,
        relaxation_time: TensorLike,
        slackness: TensorLike = 0.0,
    ) -> None:
        """See the class."""
        super().__init__(
            stiffness=stiffness,
            share=share,
            branch=branch,
            relaxation_time=relaxation_time,
            slackness=slackness,
        )

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        share: Scalar,
        branch: Scalar,
        relaxation_time: Scalar,
        slackness: Scalar,
        viscous_strain: Scalar,
        dt: Scalar,
    ) -> tuple[Scalar, Scalar]:
        """Tension [N], and the viscous strain after `dt`, exact for a strain that holds still."""
        elastic = borne(length / rest_length - 1.0 - viscous_strain, slackness)
        relaxed = 1.0 - torch.exp(-dt / relaxation_time)
        return stiffness * share * branch * rest_length * elastic, viscous_strain + relaxed * elastic

    @staticmethod
    def settled(length: Scalar, rest_length: Scalar) -> tuple[Scalar]:
        """All has relaxed."""
        return (length / rest_length - 1.0,)


class Viscoelasticity(Effect):
    """Part of the stiffness is there only for fast strains."""

    name = "viscoelasticity"
    source = MaxwellBranch.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "branch": Quantity("1", (0.01, 20.0), 0.5, log=True),
        "relaxation_time": Quantity("s", (0.02, 3.0), 0.3, log=True),
    }
    absent: ClassVar[Mapping[str, float]] = {"branch": 0.0}
    grid: ClassVar[Grid] = {"relaxation_time": (0.06, 0.25, 1.0)}
    terms = (MaxwellBranch,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "plasticity": "hold it, then let go and wait",
        "damage": "repeat the same stretch",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Add the branch to every spring."""
        share = on_springs(world, where)
        return world.with_force(
            MaxwellBranch(spring_stiffness(world), share, **values, slackness=slackness_of(world))
        )
