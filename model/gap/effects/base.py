"""What a missing effect is: physics that a plain twin lacks, as a change of its world."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.gap.world import World
from model.simulator.contacts.base import ContactTerm
from model.simulator.forces.base import ForceTerm, Scalar
from model.simulator.forces.spring import Spring

Grid: TypeAlias = Mapping[str, tuple[float, ...]]
Values: TypeAlias = Mapping[str, Tensor]
"""One scalar tensor for each quantity of an effect, or one of shape [*b, 1] for many worlds at once."""
Field: TypeAlias = Float[Tensor, " P"]
"""How strongly an effect acts on each mass point, 0..1."""
Acts: TypeAlias = Literal["body", "surroundings", "grip", "hand", "ground"]
SLACK = ("wrinkling", "tension_only")
"""Laws by which springs go slack."""


@dataclass(frozen=True)
class Quantity:
    """A parameter of an effect."""

    unit: str
    bounds: tuple[float, float]
    """What a fit stays within; beyond it the value is absurd."""
    start: float
    """Where a fit starts."""
    log: bool = False
    """Spans decades, so that a fit moves its logarithm."""
    spread: float | None = None
    """Standard deviation of what is believed beforehand, around where a fit starts: in powers of e where a
    fit moves the logarithm, else in its unit; None: nothing is."""


class Effect(ABC):
    """Physics that a plain twin lacks.

    One file each; `ALL_EFFECTS` lists them. At `absent` the world it makes moves as the one it was given.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    """The law and where it is from."""
    acts: ClassVar[Acts]
    """On what: the material, what is around it, the grip, the motion of the hand, the ground."""
    quantities: ClassVar[Mapping[str, Quantity]]
    absent: ClassVar[Mapping[str, float]]
    """Values of some quantities at which nothing is different."""
    grid: ClassVar[Grid] = {}
    """Values of some quantities that a screen tries in all combinations; the others are at their start."""
    together: ClassVar[bool] = True
    """Many values of its quantities can be rolled out at once."""
    terms: ClassVar[tuple[type[ForceTerm] | type[ContactTerm], ...]] = ()
    """What it adds to a simulator; the property tests hold them to what they claim."""
    before: ClassVar[Mapping[str, float]] = {}
    """Quantities that came later, and what they are of a twin that was saved without them."""
    stacks: ClassVar[bool] = False
    """In a world that has it already it acts on top of that, not instead of it."""
    confused_with: ClassVar[Mapping[str, str]] = {}
    """Effects that look alike, and the motion that tells them apart."""

    @abstractmethod
    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """The world with this effect.

        Args:
            world: Without it.
            values: One scalar for each of `quantities`; gradients flow to them.
            where: How strongly it acts on each mass point, 0..1; None: on all alike.
        """

    def unable(self, world: World) -> str | None:
        """Why it cannot act in this world, or None if it can."""
        return None

    def within(self, world: World) -> "Effect":
        """Itself as it acts in such a world: without quantities that do nothing there."""
        return self

    def strength(self, world: World, values: Values, where: Field | None = None) -> Field:
        """How strongly it acts on each mass point, 0..1, as a report shows it."""
        return on_points(world, where)

    @property
    def local(self) -> bool:
        """It may act in any part of the body: the law does not say where."""
        return self.acts == "body" and type(self).strength is Effect.strength

    def beside(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Factors of the twin's own parameters by which it may be looked at as well.

        A plain twin has made up for what it lacks: with fibres it is too stiff across them, and their search
        would end where there are hardly any.

        Args:
            values: Of its quantities.
        """
        return {}

    def turned(self, values: Mapping[str, float], angle: float) -> dict[str, float]:
        """The values of the same effect where all is turned by this angle [rad] about the vertical."""
        return dict(values)


def on_points(world: World, where: Field | None) -> Field:
    """The field, which is 1 everywhere where none is given."""
    count = len(world.system.points)
    return torch.ones(count, dtype=torch.float64) if where is None else where.to(torch.float64)


def on_springs(world: World, where: Field | None) -> Float[Tensor, " E"]:
    """The field on springs: the mean of their two ends."""
    field: Tensor = on_points(world, where)[world.system.springs].mean(-1)
    return field


def spring_stiffness(world: World) -> Float[Tensor, "*b E"]:
    """Stiffness of every spring [N/m], on the graph of what it depends on."""
    spring = world.simulator.force("spring")
    assert isinstance(spring, Spring)
    return _each(spring.value("stiffness"), len(world.system.springs))


def slackness_of(world: World) -> Float[Tensor, "*b E"]:
    """Share of its compression that each spring does not bear [1]: 0, but for cloth, which wrinkles."""
    count = len(world.system.springs)
    for name in SLACK:
        if name in world.simulator.forces:
            slack = world.simulator.force(name)
            return _each(slack.value("share") * slack.value("slackness"), count)
    return torch.zeros(count, dtype=torch.float64)


def with_slackness(world: World) -> World:
    """The world whose laws all know how slack its springs go, whichever was there first."""
    slackness = slackness_of(world)
    for name in world.simulator.forces:
        force = world.simulator.force(name)
        if "slackness" in force.constants and name not in SLACK:
            world = world.with_force(force.with_values(slackness=slackness))
    return world


def borne(stretch: Scalar, slackness: Scalar) -> Scalar:
    """What a spring feels of a stretch or a strain, of which below zero it does not bear a share [1]."""
    return torch.relu(stretch) + (1.0 - slackness) * torch.clamp(stretch, max=0.0)


def mass_of(world: World) -> Float[Tensor, "*b P"]:
    """Mass of every point [kg], on the graph of what it depends on."""
    return _each(world.system.value("mass"), len(world.system.points))


def _each(values: Tensor, count: int) -> Tensor:
    return values if values.ndim and values.shape[-1] == count else values.expand(*values.shape[:-1], count)


def no_ground(world: World) -> str | None:
    """Why an effect of the ground cannot act."""
    return "there is no ground" if world.ground_height is None else None


def no_springs(world: World) -> str | None:
    """Why an effect of the material cannot act."""
    return None if len(world.system.springs) else "there are no springs"


def no_grip(world: World) -> str | None:
    """Why an effect of the grip cannot act."""
    held = len(world.system.edges) - world.system.edges.spring_count
    return None if held and world.controls is not None else "nothing is held"


def vector(*components: Tensor) -> Float[Tensor, "*b n"]:
    """Quantities as one vector."""
    shape = np.broadcast_shapes(*(component.shape for component in components))
    parts = [component.expand(shape) for component in components]
    joined: Tensor = torch.stack(parts) if not shape else torch.cat(parts, -1)
    return joined
