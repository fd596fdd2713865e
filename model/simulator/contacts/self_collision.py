"""Points of the object that meet each other."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.errors import InputError
from model.simulator.contacts.base import ContactTerm
from model.simulator.contacts.coulomb import coulomb
from model.simulator.contacts.ground import SLOWEST
from model.simulator.contacts.neighbours import NeighbourSearch
from model.simulator.motion import SHORTEST
from model.simulator.parameters import Constant, TensorLike, Values
from model.simulator.system import System


class SelfCollision(ContactTerm):
    r"""Impulses with restitution and friction between points closer than the collision distance.

    Two points that come closer along their axis get opposite impulses that turn their relative velocity into
    $v_n' = -e\,v_n$ and $v_t' = v_t\,\max(0, 1 - \mu(1+e)|v_n|/|v_t|)$. A point in several contacts at once
    takes 1/c of each impulse, c the larger number of contacts of the two: momentum is kept and energy never
    grows (kinetic energy is convex in the velocity). Points joined by a spring, or closer at rest, pass.

    Args:
        system: Whose points; gives rest places and springs.
        distance: Collision distance [m]; of shape [*b, 1] for many at once, zero where nothing is to meet.
        restitution: e [1].
        friction: $\mu$ [1].

    Reference:
        Bridson, Fedkiw and Anderson (2002), Robust treatment of collisions, contact and friction for cloth
        animation, SIGGRAPH '02 (the friction impulse, and averaging impulses of simultaneous contacts).
    """

    name = "self_collision"
    internal = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "restitution": Constant("1", "scene", (0.0, 1.0)),
        "friction": Constant("1", "scene", (0.0, 2.0)),
    }

    def __init__(
        self, system: System, distance: float | Tensor, restitution: TensorLike, friction: TensorLike
    ) -> None:
        """See the class."""
        apart = torch.as_tensor(distance, dtype=torch.float64).detach()
        if not (torch.isfinite(apart).all() and (apart >= 0).all() and (apart > 0).any()):
            raise InputError(
                f"collision_distance is {distance}: give a length above zero [m], or no self-collision"
            )
        each = torch.ones_like(apart)  # so that the batch of distances is one of the constants
        super().__init__(
            restitution=torch.as_tensor(restitution) * each, friction=torch.as_tensor(friction) * each
        )
        self.distance = apart
        self._search = NeighbourSearch(system.points, system.springs, apart.reshape(-1).numpy())

    def resolve(
        self,
        positions: Float[Tensor, "*b N 3"],
        velocities: Float[Tensor, "*b N 3"],
        mass: Float[Tensor, "*m N 1"],
        dt: float,
        values: Values,
    ) -> Float[Tensor, "*b N 3"]:
        """Velocities [m/s] after the contacts of a step of `dt` [s]."""
        points, speeds = positions.reshape(-1, 3), velocities.reshape(-1, 3)
        first, second = self._touching(positions, points, speeds)
        if not len(first):
            return velocities
        weights = mass.expand(*positions.shape[:-1], 1).reshape(-1, 1)
        batch = first // positions.shape[-2]
        restitution, friction = (_each(values[name], batch) for name in ("restitution", "friction"))
        change = _impact(
            points[second] - points[first], speeds[second] - speeds[first], restitution, friction
        )
        reduced = 1.0 / (1.0 / weights[first] + 1.0 / weights[second])
        counts = torch.bincount(torch.cat([first, second]), minlength=len(points))
        share = 1.0 / torch.maximum(counts[first], counts[second]).to(change).unsqueeze(-1)
        impulse = share * reduced * change
        total = torch.zeros_like(points).index_add(0, second, impulse).index_add(0, first, -impulse)
        return velocities + (total / weights).reshape(velocities.shape)

    def meets(self, before: Float[Tensor, "*b N 3"], after: Float[Tensor, "*b N 3"]) -> bool:
        """Whether points may come within the distance on the straight way from `before` to `after` [m]."""
        return self._search.meet(before, after)

    @torch.no_grad()
    def _touching(
        self, positions: Tensor, points: Float[Tensor, "n 3"], speeds: Float[Tensor, "n 3"]
    ) -> tuple[Int[Tensor, " P"], Int[Tensor, " P"]]:
        """Pairs that are within the distance and come closer."""
        first, second = self._search.pairs(positions)
        apart = points.index_select(0, second) - points.index_select(0, first)
        distance = _each(self.distance.to(positions), first // positions.shape[-2])
        near = ((apart * apart).sum(-1) < distance**2).nonzero().squeeze(-1)
        first, second, apart = first[near], second[near], apart[near]
        closing = ((speeds[second] - speeds[first]) * apart).sum(-1) < 0
        return first[closing], second[closing]


def _impact(
    apart: Float[Tensor, "P 3"], relative: Float[Tensor, "P 3"], restitution: Tensor, friction: Tensor
) -> Float[Tensor, "P 3"]:
    """What the impact adds to the relative velocity of each pair [m/s]."""
    axis = apart / torch.linalg.vector_norm(apart, dim=-1, keepdim=True).clamp_min(SHORTEST)
    approach = -(relative * axis).sum(-1)
    tangential = relative + approach.unsqueeze(-1) * axis
    slip = torch.linalg.vector_norm(tangential, dim=-1).clamp_min(SLOWEST)
    rebound, kept = coulomb(approach, slip, restitution, friction)
    change: Tensor = (rebound + approach).unsqueeze(-1) * axis + (kept - 1.0).unsqueeze(-1) * tangential
    return change


def _each(value: Tensor, batch: Int[Tensor, " P"]) -> Tensor:
    """A constant of the scene for every pair, given which batch each pair is in."""
    return value if value.numel() == 1 else value.reshape(-1)[batch]
