"""A material that buckles instead of bearing compression."""

from collections.abc import Mapping
from typing import ClassVar

import torch

from model.gap.effects.base import (
    Effect,
    Field,
    Grid,
    Quantity,
    Values,
    no_springs,
    on_springs,
    spring_stiffness,
    with_slackness,
)
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike


class SlackSpring(AxialForce):
    r"""What a spring lacks that goes slack: $f = -\alpha\,k\,(|d| - L)$ while it is shorter than L.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        share: How strongly it acts on each spring [1], shape [spring_count].
        slackness: $\alpha$ [1]; at 1 nothing is left of the compression.

    Reference:
        Choi and Ko (2002), Stable but responsive cloth, SIGGRAPH '02 (fibres buckle under compression and
        bear almost none of it).
    """

    name = "tension_only"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "share": Constant("1", "springs", (0.0, 1.0)),
        "slackness": Constant("1", "scene", (0.0, 1.0)),
    }

    def __init__(self, stiffness: TensorLike, share: TensorLike, slackness: TensorLike) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness, share=share, slackness=slackness)

    @staticmethod
    def law(
        length: Scalar, rest_length: Scalar, stiffness: Scalar, share: Scalar, slackness: Scalar
    ) -> Scalar:
        """Tension [N]."""
        return -slackness * share * stiffness * torch.clamp(length - rest_length, max=0.0)

    @staticmethod
    def potential(
        length: Scalar, rest_length: Scalar, stiffness: Scalar, share: Scalar, slackness: Scalar
    ) -> Scalar:
        """Energy [J]."""
        return -0.5 * slackness * share * stiffness * torch.clamp(length - rest_length, max=0.0) ** 2


class TensionOnly(Effect):
    """Springs bear less compression than tension."""

    name = "tension_only"
    source = SlackSpring.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {"slackness": Quantity("1", (0.0, 0.98), 0.3)}
    absent: ClassVar[Mapping[str, float]] = {"slackness": 0.0}
    grid: ClassVar[Grid] = {"slackness": (0.3, 0.8)}
    terms = (SlackSpring,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "bending_stiffness": "fold it, and let it hang over an edge",
        "volume_preservation": "squeeze it between two fingers",
        "strain_stiffening": "stretch without folding",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        if {"wrinkling", self.name} & set(world.simulator.forces):
            return "its springs go slack already"
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Take compression away, of what damage and yield leave as well."""
        slack = SlackSpring(spring_stiffness(world), on_springs(world, where), values["slackness"])
        return with_slackness(world.with_force(slack))
