"""Twins with effects that are as much at rest in their first frame as they were without them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from model.gap.world import World
from model.simulator.forces.base import AxialForce, ForceTerm
from model.simulator.motion import Motion
from model.simulator.parameters import broadcast
from model.simulator.system import Anchors, State

ROUNDS = 8
"""Newton steps at most to a rest length: laws of effects are cubic, at worst."""
NEAR = 1e-9
"""Of the tension: so near is near enough."""
APART = 1e-4
"""Of a rest length: far enough for a difference."""
SHORTEST, LONGEST = 0.3, 1.25
"""Of the length in the first frame: no rest length is beyond. A spring that hardly bears compression could
bear what it is asked to only if it were much longer."""


@dataclass(frozen=True)
class Eased:
    """What a world with effects needs to be at rest in its first frame."""

    rest_length: Float[Tensor, "*b E"] | None
    """Of its springs [m]; None: as they are."""
    farther: Float[Tensor, "*b H 3"] | None = None
    """How much farther from what they hold the springs of its hand end [m]; None: as they do."""

    def __call__(self, world: World) -> World:
        """The world so, whichever of its effects it has yet."""
        if self.rest_length is not None:
            world = world.with_system(world.system.with_values(rest_length=self.rest_length))
        if self.farther is not None and world.controls is not None:
            world = replace(world, controls=displaced(world.controls, self.farther))
        return world


def displaced(controls: Float[Tensor, "T *b H 3"], by: Float[Tensor, "*c H 3"]) -> Float[Tensor, "T *d H 3"]:
    """Controllers that are somewhere else all the time [m], in each of many worlds maybe."""
    each = controls.unsqueeze(1) if by.ndim == controls.ndim else controls
    return each + by.to(controls.dtype)


def weighing_more(before: World, after: World) -> Float[Tensor, "*b P 3"] | None:
    """What pulls more at points that do not move [N], as weight and wind; None: nothing does.

    Args:
        before: A plain twin.
        after: The same with effects.
    """
    were = {id(term) for term in _steady(before)}
    if before.system is after.system and all(id(term) in were for term in _steady(after)):
        return None
    more = _pull(after) - _pull(before)
    return more if bool(more.any()) else None


def balanced(
    before: World, after: World, length: Float[Tensor, " E"], more: Float[Tensor, "*b E"] | None = None
) -> Float[Tensor, "*b E"] | None:
    """Rest lengths with which springs pull in the first frame as they did, and `more` [N]; None: as they are.

    Of springs that have long been as long as they are there: what relaxes has done so.

    Args:
        before: A plain twin.
        after: The same with effects.
        length: Of its springs in the first frame [m].
        more: What else springs have to bear; None: nothing.
    """
    were = {id(term) for term in _springy(before)}
    if more is None and all(id(term) in were for term in _springy(after)):
        return None
    rest = before.system.value("rest_length").double()
    wanted = _tension(before, length, rest) + (0.0 if more is None else more)
    for _ in range(ROUNDS):
        now = _tension(after, length, rest)
        if torch.allclose(now, wanted, rtol=NEAR, atol=0.0):
            break
        slope = (_tension(after, length, (1.0 + APART) * rest) - now) / (APART * rest)
        step = torch.where(slope < 0.0, (wanted - now) / slope, 0.0)
        rest = torch.minimum(torch.maximum(rest + step, SHORTEST * length), LONGEST * length)
    return rest


def _springy(world: World) -> Iterator[AxialForce]:
    """Laws of the springs within the body."""
    for name in world.simulator.forces:
        term = world.simulator.force(name)
        if isinstance(term, AxialForce) and term.internal and term.where == "springs":
            yield term


def _steady(world: World) -> Iterator[ForceTerm]:
    """Laws of what pulls at what does not move."""
    for name in world.simulator.forces:
        term = world.simulator.force(name)
        if term.steady:
            yield term


def _tension(world: World, length: Float[Tensor, " E"], rest: Float[Tensor, "*b E"]) -> Float[Tensor, "*b E"]:
    found = torch.zeros_like(rest)
    for term in _springy(world):
        found = found + term.rest_tension(length.expand(rest.shape), rest, term.values(length))
    return found


def _pull(world: World) -> Float[Tensor, "*b P 3"]:
    """Of all that pulls at points at rest [N]."""
    system = world.system
    points, mass = system.points.double(), system.value("mass").double()
    mass = mass.expand(*mass.shape[:-1], len(points)).unsqueeze(-1)
    laws = [(term, term.values(points)) for term in _steady(world)]
    shapes = [value.shape[:-1] for _, values in laws for value in values.values()]
    points = points.expand(*broadcast(mass.shape[:-2], *shapes), *points.shape)
    held = torch.zeros((system.controller_count, 3), dtype=points.dtype)
    motion = Motion(
        system.edges,
        State(points, torch.zeros_like(points)),
        Anchors(held, held) if system.controller_count else None,
        mass,
        torch.ones(len(system.edges), dtype=points.dtype),
    )
    pull = torch.zeros_like(points)
    for term, values in laws:
        pull = pull + term.force(motion, values)
    return pull
