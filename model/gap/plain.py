"""The plain twin: springs, dashpots, drag, ground and grip, and the parameters that are its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.bodies.body import Body
from model.gap.carried import carrying
from model.gap.effects.base import Quantity
from model.gap.prestress import resting_tensions
from model.gap.world import Sight, World
from model.schema import EffectRecord
from model.simulator.build import build_simulator
from model.types import Array, Observation

Values: TypeAlias = Mapping[str, Tensor]

MASS = 0.2
"""Of the body [kg]. Without forces measured, motion tells ratios to mass alone."""
SHORTEST = 0.3
"""No rest length is below this share of the length in the first frame."""
MODES = 2
"""Along the two longest axes of the body, stiffness may grow from one end to the other."""


@dataclass(frozen=True)
class Matter:
    """What a body is taken for before any fit; a fit moves the numbers that belong to all of it."""

    mass: Float64[Array, " P"]
    """[kg]."""
    pattern: Float64[Array, " E"]
    """Stiffness of each spring over the `stiffness` of the twin."""
    length: Float64[Array, " E"]
    """Rest length of each spring without prestress [m]."""
    grip_pattern: Float64[Array, " S"]
    """Stiffness of each spring of the hand over `grip` times `stiffness`."""
    grip_length: Float64[Array, " S"]
    """[m]."""
    start: Mapping[str, float]
    """Where a fit of `PlainTwin.quantities` starts."""
    restitution: float = 0.0
    collision_distance: float = 0.0
    """[m]; 0: the body does not meet itself."""

    @classmethod
    def guessed(cls, body: Body, observation: Observation) -> "Matter":
        """Of a body of which nothing is known but its shape, which is at ease but for its weight."""
        way = body.points[body.springs[:, 1]] - body.points[body.springs[:, 0]]
        length: Float64[Array, " E"] = np.linalg.norm(way, axis=1)
        reach = observation.controllers[0][body.grip[:, 0]] - body.points[body.grip[:, 1]]
        weight = MASS * max(float(np.linalg.norm(observation.gravity)), 1.0)
        start = {
            "stiffness": 30.0 * weight / body.spacing / max(1.0, len(body.points) ** 0.5),
            "damping": 0.05,
            "drag_rate": 0.3,
            "prestress": 0.8,
            "grip": 3.0,
            "friction": 0.5,
        }
        return cls(
            MASS * body.share,
            body.spacing / length,
            length,
            np.ones(len(body.grip)),
            np.linalg.norm(reach, axis=1).astype(np.float64),
            start,
        )


@dataclass(frozen=True)
class PlainTwin:
    """What makes a world of its own parameters."""

    body: Body
    observation: Observation
    matter: Matter
    tensions: Float64[Array, " E"]
    """With which the first frame is at rest [N]."""
    carried: tuple[EffectRecord, ...] = ()
    """Effects that a given twin has already."""

    @classmethod
    def of(cls, body: Body, observation: Observation, matter: Matter | None = None) -> "PlainTwin":
        """For a body as it lies, hangs or is held in the first frame; without `matter` it is guessed."""
        matter = matter or Matter.guessed(body, observation)
        borne = np.zeros(len(body.points), bool)
        borne[body.grip[:, 1]] = True
        if observation.ground_height is not None:
            borne |= body.points[:, 2] < observation.ground_height + 0.5 * body.spacing
        weights = matter.mass[:, None] * np.asarray(observation.gravity)
        tensions = resting_tensions(body.points, body.springs, weights, borne)
        return cls(body, observation, matter, tensions)

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Its own parameters, with where they may be and where a fit starts."""
        start = self.matter.start
        usual = start["stiffness"]
        own = {
            "stiffness": Quantity("N/m", (1e-3 * usual, 300.0 * usual), usual, log=True),
            "damping": _reaching("1", (1e-4, 1.0), start["damping"], log=True),
            "drag_rate": _reaching("1/s", (0.01, 20.0), start["drag_rate"], log=True),
            "prestress": Quantity("1", (0.0, 1.2), start["prestress"]),
        }
        if len(self.body.grip):
            own["grip"] = _reaching("1", (0.05, 50.0), start["grip"], log=True)
        if self.observation.ground_height is not None:
            own["friction"] = _reaching("1", (0.02, 2.0), start["friction"], log=True)
        for mode in range(0 if self.body.shape == "rope" else MODES):
            own[f"gradient_{mode + 1}"] = Quantity("1", (-1.5, 1.5), 0.0)
        return own

    def world(self, values: Values, dtype: torch.dtype = torch.float32) -> World:
        """The world of these parameters, each a scalar or of shape [*b, 1]."""
        body, seen, matter = self.body, self.observation, self.matter
        length = torch.from_numpy(matter.length)
        stiffness = values["stiffness"] * torch.from_numpy(matter.pattern) * self._gradient(values)
        tensions = torch.from_numpy(self.tensions)
        rest = torch.maximum(length - values["prestress"] * tensions / stiffness, SHORTEST * length)
        typical = 2.0 * torch.sqrt(values["stiffness"] * float(np.median(matter.mass)))
        held = len(body.grip) > 0
        simulator = build_simulator(
            points=body.points,
            mass=matter.mass,
            springs=body.springs,
            rest_length=rest,
            stiffness=stiffness,
            controller_springs=body.grip if held else None,
            controller_rest_length=matter.grip_length if held else None,
            controller_stiffness=values["grip"] * values["stiffness"] * torch.from_numpy(matter.grip_pattern)
            if held
            else None,
            controller_points=seen.controllers[0] if held else None,
            dashpot_damping=values["damping"] * typical,
            drag_rate=values["drag_rate"],
            friction=values.get("friction", 0.0),
            restitution=matter.restitution,
            collision_distance=matter.collision_distance,
            gravity=seen.gravity,
            ground_height=seen.ground_height,
            dtype=dtype,
        )
        sight = Sight(torch.from_numpy(body.index), torch.from_numpy(body.weight).to(dtype))
        controls = torch.from_numpy(seen.controllers).to(dtype) if held else None
        world = World(simulator, sight, seen.times, controls, seen.ground_height)
        return carrying(world, self.carried) if self.carried else world

    def _gradient(self, values: Values) -> Float[Tensor, "*b E"]:
        """How stiffness varies over the body, 1 on average."""
        middle = self.body.points[self.body.springs].mean(1)
        middle = middle - self.body.points.mean(0)
        axes = np.linalg.svd(self.body.points - self.body.points.mean(0), full_matrices=False)[2]
        exponent = torch.zeros(len(middle), dtype=torch.float64)
        for mode in range(MODES):
            if f"gradient_{mode + 1}" in values:
                along = middle @ axes[mode]
                exponent = exponent + values[f"gradient_{mode + 1}"] * torch.from_numpy(
                    along / np.abs(along).max()
                )
        return torch.exp(exponent)


def _reaching(unit: str, bounds: tuple[float, float], start: float, log: bool) -> Quantity:
    """A quantity whose bounds reach to where a given twin is; a logarithm starts above zero in any case."""
    low, high = bounds
    start = max(start, 0.1 * low) if log else start
    return Quantity(unit, (min(low, start), max(high, start)), start, log)
