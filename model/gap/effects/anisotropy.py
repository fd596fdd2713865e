"""A material that is stiffer one way than another."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
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
    vector,
)
from model.gap.heading import wrapped
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike

CHAINED = 2
"""Springs at most at a point of a chain."""


class FibreSpring(AxialForce):
    r"""What springs along the fibres pull more: $f = k\,\alpha\,|\cos\theta|^{2n}\,(|d| - L)$.

    How much of it there is to springs aslant, which also shear, is for n to say: the energy of a fibre's own
    strain in a spring at an angle goes with n = 2, and a lattice whose springs at 45° carry shear alone
    needs more. Of compression a spring that goes slack bears $1 - \beta$.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        alignment: $|\cos\theta|^{2n}$ [1] of the angle between spring and fibres at rest, shape
            [spring_count].
        excess: $\alpha$ [1].
        slackness: $\beta$ [1], shape [spring_count].

    Reference:
        Holzapfel, Gasser and Ogden (2000), A new constitutive framework for arterial wall mechanics, Journal
        of Elasticity 61 (a fibre term beside an isotropic one), for springs and small strains.
    """

    name = "anisotropy"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "alignment": Constant("1", "springs", (0.0, 1.0)),
        "excess": Constant("1", "scene", (0.0, 5.0)),
        "slackness": Constant("1", "springs", (0.0, 1.0)),
    }

    def __init__(
        self, stiffness: TensorLike, alignment: TensorLike, excess: TensorLike, slackness: TensorLike = 0.0
    ) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness, alignment=alignment, excess=excess, slackness=slackness)

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        alignment: Scalar,
        excess: Scalar,
        slackness: Scalar,
    ) -> Scalar:
        """Tension [N]."""
        return stiffness * alignment * excess * borne(length - rest_length, slackness)

    @staticmethod
    def potential(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        alignment: Scalar,
        excess: Scalar,
        slackness: Scalar,
    ) -> Scalar:
        """Energy [J]."""
        stretch = length - rest_length
        return 0.5 * stiffness * alignment * excess * stretch * borne(stretch, slackness)


class Anisotropy(Effect):
    """Fibres through the rest shape, all in one direction, make it stiffer along them."""

    name = "anisotropy"
    source = FibreSpring.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "excess": Quantity("1", (0.02, 20.0), 0.7, log=True),
        "azimuth": Quantity("rad", (-3.2, 3.2), 0.4),
        "elevation": Quantity("rad", (-1.6, 1.6), 0.1),
        "sharpness": Quantity("1", (1.0, 6.0), 2.0),
    }
    absent: ClassVar[Mapping[str, float]] = {"excess": 0.0}
    before: ClassVar[Mapping[str, float]] = {"sharpness": 1.0}
    grid: ClassVar[Grid] = {"azimuth": (0.0, 1.05, 2.09), "elevation": (0.0, 0.9)}
    terms = (FibreSpring,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "strain_stiffening": "stretch along two axes",
        "volume_preservation": "squeeze it between two fingers",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act: in a chain, whose springs all lie along it, it is but stiffness."""
        joined = torch.bincount(world.system.springs.flatten())
        if len(joined) and int(joined.max()) <= CHAINED:
            return "its springs have one direction, along it"
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Stiffen the springs along the fibres."""
        azimuth, elevation = values["azimuth"], values["elevation"]
        level = torch.cos(elevation)
        fibre = vector(level * torch.cos(azimuth), level * torch.sin(azimuth), torch.sin(elevation))
        ends = world.system.points[world.system.springs].to(fibre)
        way = ends[:, 1] - ends[:, 0]
        squared = (fibre @ way.T) ** 2 / (way * way).sum(-1).clamp_min(1e-18)
        along = squared ** values["sharpness"] * on_springs(world, where).to(fibre)
        return world.with_force(
            FibreSpring(spring_stiffness(world), along, values["excess"], slackness_of(world))
        )

    def beside(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """A softer body, as stiff with its fibres on average of all directions as it was without."""
        mean = 1.0 / (2.0 * values["sharpness"] + 1.0)  # of cos^2s over a sphere
        return {"stiffness": 1.0 / (1.0 + values["excess"] * mean)}

    def turned(self, values: Mapping[str, float], angle: float) -> dict[str, float]:
        """Fibres in another direction; of their two ends the one that is far from the bounds of azimuth."""
        azimuth, elevation = wrapped(values["azimuth"] + angle), values["elevation"]
        if abs(azimuth) > 0.5 * np.pi:
            azimuth, elevation = wrapped(azimuth + np.pi), -elevation
        return {**values, "azimuth": azimuth, "elevation": elevation}
