"""What a material looks like: the seam that every look fills."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
from jaxtyping import Float64

from model.types import Array

Color: TypeAlias = tuple[float, float, float]
VARIETY = 0.12
"""Spread (of the logarithm) of the brightness of things of one dye."""


@dataclass(frozen=True)
class Finish:
    """How a surface throws light back."""

    specular: float
    """Strength of reflections at normal incidence, 0..1; at grazing angles they are stronger."""
    gloss: float
    """How sharp reflections are: 0 a broad glow, 1 a mirror."""
    sheen: float = 0.0
    """How much brighter fibres are against the edge of the body."""
    wrap: float = 0.0
    """How far light creeps around into the shade, 0..1."""
    metallic: bool = False
    """Reflections take the colour of the surface, and there is little else."""
    pile: float = 0.0
    """Length of the hairs that stand out [m]."""


@dataclass(frozen=True)
class Look(ABC):
    """One piece of one material: solid textures, so that any body can be cut out of it."""

    dye: Color
    """Its main colour, RGB, 0..1."""
    seed: int
    """Of its pattern."""

    material: ClassVar[str]
    """One of `model.priors.materials.MATERIALS`."""
    dyes: ClassVar[tuple[Color, ...]]
    """The colours it comes in."""
    finish: ClassVar[Finish]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Look":
        """A piece in one of its colours."""
        dye = np.array(cls.dyes[int(rng.integers(len(cls.dyes)))])
        dye = np.clip(dye * np.exp(rng.normal(0, VARIETY)) * np.exp(rng.normal(0, 0.03, 3)), 0.03, 0.97)
        return cls(dye=(float(dye[0]), float(dye[1]), float(dye[2])), seed=int(rng.integers(1 << 30)))

    @abstractmethod
    def albedo(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """RGB, 0..1, at places in the piece [m]; the first axis is that of the grain or the warp."""

    def relief(self, place: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
        """What its unevenness adds to unit normals."""
        return np.zeros_like(place)

    def pick(self, count: int, salt: int = 0) -> int:
        """One of 0 … count-1, the same for the same piece."""
        return int(np.random.default_rng([self.seed, salt]).integers(count))
