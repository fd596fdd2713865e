"""What is missing, and how sure that is: probabilities of {none, each effect, unknown} as a verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from model.gap.classifier import CLASSES, UNKNOWN, Jury
from model.gap.evidence import Evidence
from model.gap.schema import EFFECT_NAMES, VerdictName
from model.gap.signs import Signs
from model.schema import EffectName
from model.types import Array

ALIKE = 0.9
"""Cosine of two effects' signatures, beside the twin's own parameters, above which nobody can tell."""
USUAL = {"rope": 0.35, "sheet": 0.6, "solid": 0.35}
"""Support at which the odds of an effect stay: chosen on development worlds (`benchmarks/reality`), where
nothing that is not at work in healthy ropes and solids has more than 0.28; twins of sheets are worse."""
STEP = 0.05
"""Support that changes the odds e-fold."""
BUCKLING = 1.3
"""Where the odds of slack springs stay in what buckles, a rope or a sheet: it folds between the points of its
twin, which cannot and is too stiff against being pressed together, healthy or not."""
LIMITS = (-3.0, 8.0)
"""Of the change of the odds' logarithm."""
FURTHER = 0.2
"""Support that changes the odds e-fold once that limit is reached: of several effects that explain much, what
explains most is at work."""
UNTRIED = LIMITS[0]
"""Change of the logarithm of the odds of effects that were not worth a fit: as of those that were and explain
nothing."""
ASTRAY, ASTRAY_STEP = 0.04, 0.006
"""How far free runs of a plain twin are off, as a share of the object's size, in the better followed of two
recordings, where the odds of something unknown stay, and what changes them e-fold. Of 42 worlds where nothing
is missing, moved by MuJoCo or finite elements, none is farther off than 0.043 in both recordings."""
MOST = (-1.0, 3.0)
"""Of what each part of what was seen may add to the support."""
BEYOND = 3.0
"""What an effect explains beyond the frames that it was fitted to counts at most so many times what it
explains of those. Of one that they hardly show others would have to say the strength as well, and any fits a
little."""
BESIDE, SECOND = 0.1, 0.2
"""A second effect has to explain this share beside the first, and to be this likely against it."""


@dataclass(frozen=True)
class Judged:
    """Probabilities of all that could be, as a mapping by name."""

    chances: Mapping[VerdictName, float]

    @property
    def best(self) -> VerdictName:
        """The most likely."""
        return max(self.chances, key=lambda name: self.chances[name])

    @property
    def effect(self) -> EffectName | None:
        """The most likely, if it is an effect."""
        return self.ranked[0] if self.best == self.ranked[0] else None

    @property
    def ranked(self) -> tuple[EffectName, ...]:
        """Effects, the likeliest first; of equals, in the catalogue's order."""
        return tuple(sorted(EFFECT_NAMES, key=lambda name: -self.chances[name]))

    def supported(self, supports: Mapping[EffectName, float], shape: str) -> "Judged":
        """After effects were fitted.

        What an effect explains by accident - of another mesh, of a fit that went astray - it explains neither
        later on nor of another interaction. Odds grow with the support beyond `USUAL`, and fall below it;
        those of effects that were not fitted, since others explain more, fall as well.

        Args:
            supports: `support` of each effect that was fitted.
            shape: Of the object.
        """
        untried = [name for name in EFFECT_NAMES if supports and name not in supports]
        chances = dict(self.chances) | {name: self.chances[name] * float(np.exp(UNTRIED)) for name in untried}
        for name, support in supports.items():
            usual = BUCKLING if name == "tension_only" and shape != "solid" else USUAL[shape]
            beyond = max(0.0, support - usual - LIMITS[1] * STEP) / FURTHER
            chances[name] *= float(np.exp(np.clip((support - usual) / STEP, *LIMITS) + beyond))
        whole = sum(chances.values())
        return Judged({name: chance / whole for name, chance in chances.items()})

    def puzzled(self, *astray: float) -> "Judged":
        """After the plain twin was run freely in several recordings: what it follows in none lacks something.

        Nearly chaotic motion, a fold or a fall, leads a healthy twin astray in one recording; what is missing
        is missing in all. Effects that explain it stand against this with their own odds (`supported`).

        Args:
            astray: Of each recording, how far off the refitted twin's free runs are over the object's size.
        """
        chances = dict(self.chances)
        chances[UNKNOWN] *= float(np.exp(np.clip((min(astray) - ASTRAY) / ASTRAY_STEP, *LIMITS)))
        whole = sum(chances.values())
        return Judged({name: chance / whole for name, chance in chances.items()})


def support(fitted: tuple[float, float], *beyond: tuple[float, float]) -> float:
    """Of an effect by what it explains: the sum of log(without / with) over the parts of what was seen.

    As for a likelihood whose noise is what remains: halves of what was left count the same, however much
    there was.

    Args:
        fitted: Mean squares that the refitted twin leaves without it and with it, in frames that fits see.
        beyond: The same of other frames: later ones, another recording.
    """
    first, *others = (
        float(np.clip(np.log(max(without, 1e-12) / max(with_it, 1e-12)), *MOST))
        for without, with_it in (fitted, *beyond)
    )
    return first + sum(min(other, BEYOND * max(first, 0.0)) for other in others)


def judged(jury: Jury, signs: Signs) -> Judged:
    """What a jury says of one recording."""
    chances = jury.probabilities([signs])[0]
    return Judged({name: float(chance) for name, chance in zip(CLASSES, chances, strict=True)})


def second_of(verdict: Judged, signs: Signs, evidence: Evidence) -> EffectName | None:
    """An effect that may be at work beside the first; whether it is, is for fits to say."""
    first = verdict.ranked[0]
    if first not in signs.names:
        return None
    probe = dict(zip(signs.names, signs.probe.tolist(), strict=True))
    others = [
        name for name in verdict.ranked[1:] if name in probe and name not in alike(evidence, signs, first)
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
