"""What the laws see of the system at one instant."""

from functools import cached_property
from typing import Literal, TypeAlias

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.edges import Edges
from model.simulator.system import Anchors, State

Where: TypeAlias = Literal["springs", "controllers", "edges"]

SHORTEST = 1e-12
"""Length [m] below which an edge has no direction and pulls nowhere."""


class Motion:
    """Positions and velocities, and the geometry of every edge, each quantity computed when first asked for.

    All force terms of a substep share one, so that springs and dashpots make a single pass over the edges.
    """

    def __init__(
        self,
        edges: Edges,
        state: State,
        anchors: Anchors | None,
        mass: Float[Tensor, "*m N 1"],
        rest_length: Float[Tensor, "*r e"],
    ) -> None:
        """Look at `state` [m, m/s] with the controllers at `anchors`; `rest_length` [m] is one per edge."""
        self.edges, self.mass, self.rest_length = edges, mass, rest_length
        self.positions, self.velocities, self.anchors = state.positions, state.velocities, anchors

    @cached_property
    def displacement(self) -> Float[Tensor, "*b e 3"]:
        """From the first to the second end [m]."""
        return self.edges.difference(
            _nodes(self.positions, None if self.anchors is None else self.anchors.positions)
        )

    @cached_property
    def length(self) -> Float[Tensor, "*b e"]:
        """[m]."""
        length: Tensor = torch.linalg.vector_norm(self.displacement, dim=-1)
        return length.clamp_min(SHORTEST)

    @cached_property
    def axis(self) -> Float[Tensor, "*b e 3"]:
        """Unit vector from the first to the second end."""
        return self.displacement / self.length.unsqueeze(-1)

    @cached_property
    def relative_velocity(self) -> Float[Tensor, "*b e 3"]:
        """Velocity of the second end seen from the first [m/s]."""
        return self.edges.difference(
            _nodes(self.velocities, None if self.anchors is None else self.anchors.velocities)
        )

    @cached_property
    def rate(self) -> Float[Tensor, "*b e"]:
        """How fast the edge lengthens [m/s]."""
        return (self.relative_velocity * self.axis).sum(-1)

    def over(self, values: Tensor, where: Where, dim: int = -1) -> Tensor:
        """The share of `values`, one per edge along `dim`, that belongs to `where`."""
        springs, held = self.edges.spring_count, self.edges.controller_spring_count
        if where == "edges" or (where == "springs" and not held):
            return values
        return values.narrow(dim, 0, springs) if where == "springs" else values.narrow(dim, springs, held)

    def join(
        self, springs: Tensor | None, controllers: Tensor | None, like: Tensor, dim: int = -1
    ) -> Tensor | None:
        """One value per edge from those of springs and of controller springs; zeros for one that is None."""
        if springs is None and controllers is None:
            return None
        if not self.edges.controller_spring_count:
            return springs
        if springs is None:
            springs = torch.zeros_like(self.over(like, "springs", dim))
        if controllers is None:
            controllers = torch.zeros_like(self.over(like, "controllers", dim))
        return torch.cat([springs, controllers], dim)

    def pull(self, forces: Float[Tensor, "*b e 3"]) -> Float[Tensor, "*b N 3"]:
        """Net force [N] on each point of edges that pull their first end with `forces` [N]."""
        total = -self.edges.total(forces)
        return total if self.anchors is None else total.narrow(-2, 0, self.edges.point_count)


def _nodes(points: Tensor, anchors: Tensor | None) -> Tensor:
    if anchors is None:
        return points
    return torch.cat([points, anchors.expand(*points.shape[:-2], *anchors.shape[-2:])], -2)
