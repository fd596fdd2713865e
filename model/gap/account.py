"""What a verdict is made of: how much each fitted effect explains, and how much there is to be explained."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from model.schema import EffectName
from model.types import Array

MOST = (-1.0, 6.0)
"""Of what an effect may explain of one part of what was seen."""
BEYOND = 1.0
"""What an effect explains beyond the frames that it was first fitted to counts at most so many times what it
explains of those. Of one that they hardly show others would have to say the strength as well, and any fits a
little; and a twin that is lost without an effect, and with it is not, may have been lost by chance."""

FINEST = 1e-3
"""No lattice follows a body more closely than this [m], however good the sensor: what is left is told against
no less noise."""

MUCH, NOISE = 0.5, 2.0
"""Share of what is left, and times the noise, from which what other lattices leave is worth a word."""
LEAST = 1e-12
"""Of what is left: as good as nothing."""

MEANING = 5
"""Of an account, counted up whenever what it tells is measured otherwise: no weights are learned of both."""

Left = tuple[float, float]
"""Mean squares that the refitted twin leaves unexplained without an effect, and with it."""


@dataclass(frozen=True)
class Explained:
    """How many times less a twin leaves unexplained with an effect, as a logarithm, by part of what was seen.

    As for a likelihood whose noise is what remains: halves of what was left count the same, however much
    there was.
    """

    fitted: float = 0.0
    """In the frames that fits see."""
    later: float = 0.0
    """In later frames of the same recording."""
    elsewhere: float = 0.0
    """In another recording; 0: there is none, or the effect cannot act there, or explains nothing here."""

    slowly: float = 0.0
    """In all frames of the same recording, as a slow observer sees them (`slowly`)."""
    slowly_elsewhere: float = 0.0
    """In all of the other one."""

    @classmethod
    def of(
        cls, fitted: Left, later: Left, elsewhere: Left | None = None, slowly: tuple[float, ...] = ()
    ) -> "Explained":
        """From what is left in each part; and what is explained slowly here, and in the other recording."""
        first = _explained(fitted)
        most = BEYOND * max(first, 0.0)
        others = (min(_explained(left), most) if left is not None else 0.0 for left in (later, elsewhere))
        return cls(first, *others, *(float(np.clip(one, *MOST)) for one in slowly))


@dataclass(frozen=True)
class Account:
    """Of one diagnosis."""

    shape: str
    """Of the object: rope, sheet or solid."""
    screened: Mapping[EffectName, float]
    """Probability of each effect by score tests, before any was fitted."""
    explained: Mapping[EffectName, Explained]
    """By each effect, fitted to the first recording alone."""
    shared: Mapping[EffectName, Explained]
    """By each effect, as strong in both recordings and fitted to both at once; empty: there is no other."""
    left: tuple[float, ...]
    """Mean square of what the plain twin leaves unexplained in each recording, its parameters fitted to it,
    over that of the noise, or of `FINEST` where the sensor is better."""
    flexible: Explained | None = None
    """By a force that may be any missing physics (`ceiling`), fitted to the first recording; None: nobody
    asked."""
    lattices: tuple[float | None, ...] = ()
    """What the plain twin leaves in each recording of itself on other lattices (`lattices`), told as `left`
    is; None: there are none; empty: nobody asked."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "Account":
        """From what `dataclasses.asdict` makes of one, through JSON."""
        explained, shared = (
            {name: Explained(**each) for name, each in content[part].items()}
            for part in ("explained", "shared")
        )
        left = tuple(content["left"])
        told = content.get("flexible")
        flexible = None if told is None else Explained(**told)
        lattices = tuple(content.get("lattices", ()))
        return cls(content["shape"], content["screened"], explained, shared, left, flexible, lattices)

    @property
    def told(self) -> Mapping[EffectName, Explained]:
        """What counts: of both recordings at once, where there are two."""
        return self.shared or self.explained

    @property
    def of_lattice(self) -> bool:
        """The twin leaves half as much of itself on other lattices as of what was seen, or more."""
        lattices = self.lattices[0] if self.lattices else None
        return lattices is not None and lattices > max(MUCH * self.left[0], NOISE)

    @property
    def alone(self) -> "Account":
        """The same without the other recording."""
        return replace(self, shared={}, left=self.left[:1], lattices=self.lattices[:1])


def against_ordinary(left: float, noise: float) -> float:
    """What is left over the noise [m], told against `FINEST` where the noise is less."""
    return left * min(noise / FINEST, 1.0) ** 2


def e_folds(without: Float64[Array, " k"], with_it: Float64[Array, " k"]) -> Float64[Array, " k"]:
    """How many times less is left with an effect than without it, as a logarithm."""
    logarithm: Float64[Array, " k"] = np.log(np.maximum(without, LEAST) / np.maximum(with_it, LEAST))
    return logarithm


def _explained(left: Left) -> float:
    without, with_it = np.array(left, np.float64)[:, None]
    return float(np.clip(e_folds(without, with_it), *MOST).item())
