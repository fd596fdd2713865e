"""A material that resists being bent."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, on_points
from model.gap.world import World
from model.simulator.forces.bending import Bending
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.structure import is_line, rows, spans, turns


class BendingStiffness(Effect):
    """Every row of points bends like an elastic rod, at rest between straight and as it is seen at first.

    That of a rope knows in which direction; those of a net hardly need to, since others cross them.
    """

    name = "bending_stiffness"
    source = f"{Bending.__doc__}{CurvedBending.__doc__}"
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "bending_stiffness": Quantity("N·m²", (1e-8, 1.0), 1e-4, log=True),
        "memory_of_shape": Quantity("1", (0.0, 1.0), 0.5),
    }
    absent: ClassVar[Mapping[str, float]] = {"bending_stiffness": 0.0}
    grid: ClassVar[Grid] = {
        "bending_stiffness": (1e-6, 1e-4, 1e-2),
        "memory_of_shape": (0.0, 1.0),
    }
    terms = (Bending, CurvedBending)
    confused_with: ClassVar[Mapping[str, str]] = {
        "tension_only": "let it stick out over an edge",
        "volume_preservation": "bend it without squeezing it",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return None if len(_rows(world)) else "no three points are in a row"

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Make every row a rod."""
        triples = _rows(world)
        points = world.system.points.double().numpy()
        share = on_points(world, where)[torch.from_numpy(triples[:, 1])]
        kind = CurvedBending if is_line(points, world.system.springs.numpy()) else Bending
        return world.with_force(
            kind(
                torch.from_numpy(triples),
                bending_stiffness=values["bending_stiffness"] * share.to(values["bending_stiffness"]),
                span=spans(points, triples),
                rest_turn=values["memory_of_shape"] * torch.from_numpy(turns(points, triples)),
            )
        )


def _rows(world: World) -> np.ndarray:
    return rows(world.system.points.double().numpy(), world.system.springs.numpy())
