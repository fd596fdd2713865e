"""What a world is, whichever generator moves it: object, material, hands, surroundings, effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

Array = np.ndarray
Kind = Literal["rope", "sheet", "solid"]


@dataclass(frozen=True)
class Field:
    """Where an effect acts, 0..1, as a smooth function of rest positions [m]."""

    kind: Literal["everywhere", "half", "ball"] = "everywhere"
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)
    width: float = 0.02
    """Radius of a ball, or width of the edge of a half [m]."""

    def __call__(self, rest: Array) -> Array:
        """Share at `rest` [n, 3]."""
        away = rest - np.asarray(self.centre)
        if self.kind == "everywhere":
            return np.ones(len(rest))
        if self.kind == "half":
            return 1.0 / (1.0 + np.exp(-np.clip(away @ np.asarray(self.direction) / self.width, -40, 40)))
        return np.exp(-0.5 * (away**2).sum(axis=1) / self.width**2)


@dataclass(frozen=True)
class Effect:
    """One thing that a plain twin lacks; `options` are what its name needs besides the amplitude."""

    name: str
    amplitude: float
    options: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    where: Field = field(default_factory=Field)


@dataclass(frozen=True)
class Material:
    """The base law, linear: what a plain twin can take on."""

    density: float
    """kg/m, kg/m² or kg/m³."""
    stiffness: tuple[float, float]
    """Young's modulus of the two halves of the object: N, N/m or Pa."""
    poisson: float
    damping: float
    """Viscosity over stiffness [s]."""
    drag_rate: float
    """[1/s]."""
    friction: float
    restitution: float
    bending: float = 0.0
    """Of a sheet, over weight per area times length cubed: a little keeps folds larger than the mesh."""


@dataclass(frozen=True)
class Hand:
    """A grip and where it goes."""

    place: Array
    """Centre of the grip in the first frame [3] m."""
    reach: float
    """What is nearer than this [m] is held."""
    offset: Array
    """Displacement of the centre [samples, 3] m, at `RATE`."""
    turn: Array
    """Rotation vector about the centre [samples, 3]."""


RATE = 240.0
"""Samples of a hand's motion per second."""


@dataclass(frozen=True)
class Scene:
    """Everything that is not the object's own."""

    times: Array
    hands: tuple[Hand, ...]
    turn: Array
    """Rotation of the object's rest shape into the first frame [3, 3]."""
    shift: Array
    """And its translation [3] m."""
    ground: float | None
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    interaction: str = ""


@dataclass(frozen=True)
class World:
    """Ready to be simulated."""

    shape: "Shape"  # noqa: F821
    material: Material
    scene: Scene
    effects: tuple[Effect, ...] = ()
    spacing: float = 0.02
    """Between nodes [m]."""
    mesh_seed: int = 0

    def with_effects(self, *effects: Effect) -> "World":
        """The same world, other effects."""
        return replace(self, effects=effects)


@dataclass(frozen=True)
class Motion:
    """What happened, without any sensor."""

    points: Array
    """Material points on the surface [T, N, 3] m."""
    acts: Mapping[str, Array]
    """Per effect, how strongly it acted on each of the points [N], 0..1."""
    nodes: Array
    """[T, n, 3] m."""
    energy: Array
    """[T, 4] J: kinetic, elastic, of height, done by the hands; empty where nobody keeps account."""


class Runaway(Exception):
    """A simulation that left the finite numbers."""
