"""What the user of a playground can change about a twin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from model.bundle import TwinBundle
from model.formats.parameters import gravity, ground_height, scalar
from model.gap.carried import CATALOGUE, values_of
from model.schema import EffectRecord

AIR_GRIP = CATALOGUE["wind"].quantities["drag_per_mass"].start
"""How strongly air pulls at a twin of which nothing is known about that [1/m]."""


@dataclass(frozen=True)
class Settings:
    """The mechanics of a twin as the user has set them."""

    gravity: tuple[float, float, float]
    """[m/s²]."""
    ground: bool
    ground_height: float
    """[m]; counts where there is a ground."""
    friction: float
    """[1]."""
    restitution: float
    """[1]."""
    dashpot_damping: float
    """[N·s/m]."""
    drag_rate: float
    """[1/s]."""
    self_contact: bool
    wind: tuple[float, float]
    """Velocity of the air along x and y [m/s]."""
    air_grip: float
    """How strongly moving air pulls, per mass [1/m]."""
    stiffness: tuple[float, ...]
    """Factor on the stiffness of each part [1]."""
    effects: bool = True
    """The effects that the twin carries act."""


def settings_of(bundle: TwinBundle) -> Settings:
    """The twin as it came."""
    parameters = bundle.parameters
    height = ground_height(parameters)
    lowest = float(bundle.topology.points[:, 2].min())
    blowing = wind_of(bundle.effects)
    return Settings(
        gravity=gravity(parameters),
        ground=height is not None,
        ground_height=lowest if height is None else height,
        friction=scalar(parameters, "friction", 0.0),
        restitution=scalar(parameters, "restitution", 0.0),
        dashpot_damping=scalar(parameters, "dashpot_damping", 0.0),
        drag_rate=scalar(parameters, "drag_rate", 0.0),
        self_contact=scalar(parameters, "collision_distance", 0.0) > 0,
        wind=(blowing.get("x", 0.0), blowing.get("y", 0.0)),
        air_grip=blowing.get("drag_per_mass", AIR_GRIP),
        stiffness=(1.0,) * part_count(bundle),
    )


def part_count(bundle: TwinBundle) -> int:
    """Parts of a twin, whether or not `parts.json` describes them."""
    return max(len(bundle.parts), int(np.max(bundle.topology.part)) + 1)


def wind_of(effects: Sequence[EffectRecord]) -> dict[str, float]:
    """The values of the wind that a twin carries; none where it carries none."""
    found = next((record for record in effects if record.name == "wind"), None)
    return {} if found is None else values_of(found, "effects.json: wind")
