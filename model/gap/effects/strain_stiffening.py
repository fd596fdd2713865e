"""A material that stiffens as it is strained."""

from collections.abc import Mapping
from typing import ClassVar

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


class CubicSpring(AxialForce):
    r"""What a spring pulls more than a linear one.

    $f = k\,\alpha\,L\,\varepsilon^3$, with $\varepsilon = |d|/L - 1$; of compression a spring that goes
    slack bears $1 - \beta$.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        share: How strongly it acts on each spring [1], shape [spring_count].
        stiffening: $\alpha$ [1].
        slackness: $\beta$ [1], shape [spring_count].

    Reference:
        Fung (1993), Biomechanics: Mechanical properties of living tissues, chapter 7 (soft tissue stiffens
        with strain); the cubic term is the first of the odd series.
    """

    name = "strain_stiffening"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "share": Constant("1", "springs", (0.0, 1.0)),
        "stiffening": Constant("1", "scene", (0.0, 300.0)),
        "slackness": Constant("1", "springs", (0.0, 1.0)),
    }

    def __init__(
        self, stiffness: TensorLike, share: TensorLike, stiffening: TensorLike, slackness: TensorLike = 0.0
    ) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness, share=share, stiffening=stiffening, slackness=slackness)

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        share: Scalar,
        stiffening: Scalar,
        slackness: Scalar,
    ) -> Scalar:
        """Tension [N]."""
        strain = length / rest_length - 1.0
        return stiffness * share * stiffening * rest_length * strain**2 * borne(strain, slackness)

    @staticmethod
    def potential(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        share: Scalar,
        stiffening: Scalar,
        slackness: Scalar,
    ) -> Scalar:
        """Energy [J]."""
        strain = length / rest_length - 1.0
        fourth = strain**3 * borne(strain, slackness)
        return 0.25 * stiffness * share * stiffening * rest_length**2 * fourth


class StrainStiffening(Effect):
    """The springs stiffen with strain, in tension and, as far as they bear it, in compression."""

    name = "strain_stiffening"
    source = CubicSpring.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "stiffening": Quantity("1", (0.1, 2000.0), 20.0, log=True)
    }
    absent: ClassVar[Mapping[str, float]] = {"stiffening": 0.0}
    grid: ClassVar[Grid] = {"stiffening": (5.0, 60.0, 500.0)}
    terms = (CubicSpring,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "damage": "stretch up and down a staircase",
        "anisotropy": "stretch along two axes",
        "tension_only": "stretch without folding",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Add the cubic part to every spring."""
        return world.with_force(
            CubicSpring(
                spring_stiffness(world), on_springs(world, where), values["stiffening"], slackness_of(world)
            )
        )
