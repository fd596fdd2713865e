"""A material that bulges where it is squeezed."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, on_points
from model.gap.world import World
from model.simulator.forces.volume import Volume
from model.simulator.structure import cells, faces


class VolumePreservation(Effect):
    """Every cell between neighbouring points resists a change of its volume."""

    name = "volume_preservation"
    source = Volume.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "bulk_modulus": Quantity("N/m²", (1.0, 1e7), 1e4, log=True)
    }
    absent: ClassVar[Mapping[str, float]] = {"bulk_modulus": 0.0}
    grid: ClassVar[Grid] = {"bulk_modulus": (1e2, 3e3, 1e5)}
    terms = (Volume,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "anisotropy": "squeeze it between two fingers",
        "bending_stiffness": "bend it without squeezing it",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return None if len(_cells(world)[0]) else "the object has no volume"

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Give every cell its volume to keep."""
        corners, volumes = _cells(world)
        share = on_points(world, where)[torch.from_numpy(corners)].mean(-1)
        modulus = values["bulk_modulus"] * share.to(values["bulk_modulus"])
        return world.with_force(Volume(torch.from_numpy(corners), bulk_modulus=modulus, rest_volume=volumes))


def _cells(world: World) -> tuple[np.ndarray, np.ndarray]:
    """None of a sheet, whose folds may hold some."""
    points = world.system.points.double().numpy()
    if len(faces(points, world.system.springs.numpy())):
        return np.zeros((0, 4), np.int64), np.zeros(0)
    return cells(points, world.spacing)
