"""What is missing, and how sure that is: probabilities of {none, each effect, unknown} as a verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from model.gap.classifier import CLASSES, NONE, UNKNOWN, Jury
from model.gap.effects.base import Effect
from model.gap.evidence import Evidence
from model.gap.schema import EFFECT_NAMES, VerdictName
from model.gap.signs import Signs
from model.gap.world import World
from model.schema import EffectName
from model.types import Array

ALIKE = 0.9
"""Cosine of two effects' signatures, beside the twin's own parameters, above which nobody can tell."""
BESIDE, SECOND = 0.1, 0.2
"""A second effect has to explain this share beside the first, and to be this likely against it."""


@dataclass(frozen=True)
class Judged:
    """Probabilities of all that could be, as a mapping by name."""

    chances: Mapping[VerdictName, float]

    @property
    def best(self) -> VerdictName:
        """The most probable; of equals "none", then an effect, the first in the catalogue's order."""
        return max((NONE, *self.ranked, UNKNOWN), key=lambda name: self.chances[name])

    @property
    def effect(self) -> EffectName | None:
        """The best, if it is an effect."""
        return self.ranked[0] if self.best == self.ranked[0] else None

    @property
    def ranked(self) -> tuple[EffectName, ...]:
        """Effects, the likeliest first; of equals, in the catalogue's order."""
        return tuple(sorted(EFFECT_NAMES, key=lambda name: -self.chances[name]))


def judged(jury: Jury, signs: Signs) -> Judged:
    """What a jury says of one recording."""
    chances = jury.probabilities([signs])[0]
    return Judged({name: float(chance) for name, chance in zip(CLASSES, chances, strict=True)})


def second_of(
    verdict: Judged,
    signs: Signs,
    evidence: Evidence,
    effects: Mapping[EffectName, Effect],
    world: World,
) -> EffectName | None:
    """An effect that may be at work beside the first; whether it is, is for fits to say.

    Args:
        verdict: Whose likeliest effect is the first.
        signs: What the recording shows of each effect.
        evidence: What these are of.
        effects: Those that can act.
        world: With the first, beside which not all of them can.
    """
    first = verdict.ranked[0]
    if first not in signs.names:
        return None
    probe = dict(zip(signs.names, signs.probe.tolist(), strict=True))
    others = [
        name
        for name in verdict.ranked[1:]
        if name in probe and name not in alike(evidence, signs, first) and effects[name].unable(world) is None
    ]
    if not others:
        return None
    likely = verdict.chances[others[0]] >= SECOND * verdict.chances[first]
    explained = _explained(evidence, [probe[first]], probe[others[0]])
    return others[0] if likely and explained >= BESIDE else None


def alike(evidence: Evidence, signs: Signs, name: str) -> tuple[EffectName, ...]:
    """Effects of which this recording shows the same signature."""
    cosines = isolability(evidence, signs)
    if name not in signs.names:
        return ()
    row = np.abs(cosines[signs.names.index(name)])
    return tuple(
        other for other, cosine in zip(signs.names, row, strict=True) if other != name and cosine > ALIKE
    )


def isolability(evidence: Evidence, signs: Signs) -> Float64[Array, "e e"]:
    """Cosines between the effects' signatures with the directions of the twin's own parameters taken out."""
    whole = evidence.weighed.grams.sum(0)
    left = _projected(whole, evidence.of("twin"))
    some = left[np.ix_(signs.probe, signs.probe)]
    size = np.sqrt(np.maximum(np.diagonal(some), 1e-300))
    cosines: Float64[Array, "e e"] = some / size / size[:, None]
    return cosines


def _explained(evidence: Evidence, beside: Sequence[int], tried: int) -> float:
    """Share of what is left that one column explains beside others."""
    left = _projected(evidence.weighed.grams.sum(0), [*evidence.of("twin"), *beside])
    return float(left[tried, -1] ** 2 / max(left[tried, tried] * left[-1, -1], 1e-300))


def _projected(whole: Float64[Array, "p p"], onto: Sequence[int]) -> Float64[Array, "p p"]:
    """Inner products of what columns are beside some of them."""
    some = list(onto)
    normal = whole[np.ix_(some, some)]
    normal = normal + 1e-6 * np.diag(np.diagonal(normal) + 1e-12)
    return np.asarray(whole - whole[:, some] @ np.linalg.solve(normal, whole[some]))
