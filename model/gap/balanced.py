"""Twins with effects that are as much at rest in their first frame as they were without them."""

from collections.abc import Iterator

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


def weighing_more(before: World, after: World) -> Float[Tensor, "*b P 3"] | None:
    """What pulls more at points that do not move [N], as weight and wind; None: nothing does.

    Args:
        before: A plain twin.
        after: The same with effects.
    """
    were = {id(term) for term in _steady(before)}
    others = [term for term in _steady(after) if id(term) not in were]
    heavier = before.system is not after.system
    if not others and not heavier:
        return None
    more = _pull(after) - _pull(before)
    return more if bool(more.any()) else None


def balanced(
    before: World, after: World, length: Float[Tensor, " E"], more: Float[Tensor, "*b E"] | None = None
) -> World:
    """The world with such rest lengths that its springs pull in the first frame as they did, and `more` [N].

    Of springs that have long been as long as they are there: what relaxes has done so.

    Args:
        before: A plain twin.
        after: The same with effects.
        length: Of its springs in the first frame [m].
        more: What else springs have to bear; None: nothing.
    """
    were = {id(term) for term in _springy(before)}
    if more is None and all(id(term) in were for term in _springy(after)):
        return after
    rest = before.system.value("rest_length").double()
    wanted = _tension(before, length, rest) + (0.0 if more is None else more)
    rest = rest.expand((wanted + _tension(after, length, rest)).shape)
    for _ in range(ROUNDS):
        now = _tension(after, length, rest)
        if torch.allclose(now, wanted, rtol=NEAR, atol=0.0):
            break
        slope = (_tension(after, length, (1.0 + APART) * rest) - now) / (APART * rest)
        step = torch.where(slope < 0.0, (wanted - now) / slope, 0.0)
        rest = torch.minimum(torch.maximum(rest + step, SHORTEST * length), LONGEST * length)
    return after.with_system(after.system.with_values(rest_length=rest))


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
