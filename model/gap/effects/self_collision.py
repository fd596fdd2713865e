"""A body that meets itself."""

from collections.abc import Mapping
from typing import ClassVar

import torch

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values
from model.gap.world import World
from model.simulator.contacts.self_collision import SelfCollision


class SelfContact(Effect):
    """Points of the body that are not neighbours cannot pass through each other."""

    name = "self_collision"
    source = SelfCollision.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "distance": Quantity("spacings", (0.2, 1.5), 0.9),
        "friction": Quantity("1", (0.0, 2.0), 0.3),
    }
    absent: ClassVar[Mapping[str, float]] = {"distance": 0.0}
    grid: ClassVar[Grid] = {"distance": (0.5, 0.9)}
    terms = (SelfCollision,)
    confused_with: ClassVar[Mapping[str, str]] = {"tension_only": "fold it so that its sides touch"}

    @property
    def local(self) -> bool:
        """Where parts meet, and nowhere else."""
        return False

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let points collide; the distance is a choice, and has no gradient.

        They bounce as they did where they collided before, and else not at all.
        """
        distance = values["distance"].detach() * world.spacing
        if not bool((distance > 0).any()):
            return world
        restitution = torch.tensor(0.0)
        if self.name in world.simulator.contacts:
            restitution = world.simulator.contact(self.name).value("restitution")
        return world.with_contact(SelfCollision(world.system, distance, restitution, values["friction"]))
