"""A material that has been stretched is softer after it."""

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


class DamagedSpring(AxialForce):
    r"""What a damaged spring lacks.

    $f = -k\,(|d| - L)\,\alpha\,\tanh(g/s)$ with $g = (m - p\,\max(\varepsilon, 0))_+$, where m is the
    largest strain $\varepsilon$ that the spring has seen; of compression no more than $1 - \beta$ of it is
    lost, which is all that a slack spring bears.

    With p = 0 what is lost is lost at any strain, also while it is strained for the first time; with p = 1 on
    the way back alone: where it is strained as far as ever it has all of its stiffness.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        share: How strongly it acts on each spring [1], shape [spring_count].
        softening: $\alpha$ [1]: the share of the stiffness that can be lost.
        damage_strain: s [1], at which three quarters of that are lost.
        pseudo_elasticity: p [1], 0..1.
        slackness: $\beta$ [1], shape [spring_count].

    Reference:
        Mullins (1969), Softening of rubber by deformation, Rubber chemistry and technology 42 (the stress
        depends on the largest strain before); Simo (1987), On a fully three-dimensional finite-strain
        viscoelastic damage model, Computer methods in applied mechanics and engineering 60 (a strain-driven
        damage variable, as with p = 0); Ogden and Roxburgh (1999), A pseudo-elastic model for the Mullins
        effect in filled rubber, Proceedings of the Royal Society A 455 (by how far it is below, as with
        p = 1; with an error function).
    """

    name = "damage"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "share": Constant("1", "springs", (0.0, 1.0)),
        "softening": Constant("1", "scene", (0.0, 0.9)),
        "damage_strain": Constant("1", "scene", (0.02, 0.3)),
        "pseudo_elasticity": Constant("1", "scene", (0.0, 1.0)),
        "slackness": Constant("1", "springs", (0.0, 1.0)),
    }
    memory: ClassVar[Mapping[str, float]] = {"largest_strain": 0.0}

    def __init__(
        self,
        stiffness: TensorLike,
        share: TensorLike,
        softening: TensorLike,
        damage_strain: TensorLike,
        pseudo_elasticity: TensorLike,
        slackness: TensorLike,
    ) -> None:
        """See the class."""
        super().__init__(
            stiffness=stiffness,
            share=share,
            softening=softening,
            damage_strain=damage_strain,
            pseudo_elasticity=pseudo_elasticity,
            slackness=slackness,
        )

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        share: Scalar,
        softening: Scalar,
        damage_strain: Scalar,
        pseudo_elasticity: Scalar,
        slackness: Scalar,
        largest_strain: Scalar,
    ) -> tuple[Scalar, Scalar]:
        """What the tension loses [N], and the largest strain so far."""
        strain = length / rest_length - 1.0
        largest = torch.maximum(largest_strain, strain)
        beyond = torch.relu(largest - pseudo_elasticity * torch.relu(strain))
        lost = share * softening * torch.tanh(beyond / damage_strain)
        return -stiffness * lost * borne(length - rest_length, slackness), largest

    @staticmethod
    def settled(length: Scalar, rest_length: Scalar) -> tuple[Scalar]:
        """The largest strain so far is the one that it has."""
        return (torch.relu(length / rest_length - 1.0),)


class Damage(Effect):
    """Springs soften by the largest stretch they have seen."""

    name = "damage"
    source = DamagedSpring.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "softening": Quantity("1", (0.0, 0.99), 0.3),
        "damage_strain": Quantity("1", (0.005, 0.5), 0.05, log=True),
        "pseudo_elasticity": Quantity("1", (0.0, 1.0), 0.5),
    }
    absent: ClassVar[Mapping[str, float]] = {"softening": 0.0}
    grid: ClassVar[Grid] = {"damage_strain": (0.01, 0.05, 0.2), "pseudo_elasticity": (0.0, 1.0)}
    terms = (DamagedSpring,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "plasticity": "stretch to the same length again",
        "viscoelasticity": "repeat the stretch after a long rest",
        "strain_stiffening": "stretch up and down a staircase",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act: yield leaves another free length, of which this law would know nothing."""
        if "plasticity" in world.simulator.forces:
            return "its springs yield, and are no longer free at their first length"
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Take away what damage takes."""
        share = on_springs(world, where)
        return world.with_force(
            DamagedSpring(spring_stiffness(world), share, **values, slackness=slackness_of(world))
        )
