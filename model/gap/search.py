"""Which effects are worth a fit, and where it begins: probes of many strengths, then one step from the best.

What is clear is far from linear: a hand that is a third of a second late is foretold by no multiple of what a
delay of 0.03 s does. So each effect is tried at sizes from faint to overwhelming before any is left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from model.gap.belief import LOOSE
from model.gap.effects.base import Effect, Field
from model.gap.fields import halves_of, tensor
from model.gap.heading import heading
from model.gap.misfit import STEPS, Misfit
from model.gap.probes import probes
from model.gap.schema import EFFECT_NAMES
from model.gap.side_by_side import side_by_side
from model.gap.stages import Portion
from model.gap.study import Study
from model.schema import EffectName
from model.types import Array

STRENGTHS = (0.25, 1.0, 4.0, 16.0)
"""Of what a probe is."""
DEAREST = 3.0
"""Nothing is tried that needs so many times finer time steps than the plain twin, but for what needs the
fewest: all that is looked at beside it would get as many, and a fit comes to it from a fainter one."""
FAINT = 0.04
"""So little that hardly anything is different: where an effect begins that helps in no strength."""
HALF = 0.9
"""An effect acts in a half of the body if it leaves less than this share there of what it does everywhere."""
IN_PLACES = (1.0, 4.0)
"""Strengths that are looked at in a half."""
STEPPED = 10
"""Effects that promise most get a step; what promises less has seldom led to anything."""
SHARES = (1.0, 0.5, 0.2)
"""Of a step, the best of which is taken: a whole one may lead across a kink."""


@dataclass(frozen=True)
class Begun:
    """Where a fit of a twin with effects may begin."""

    vector: Float64[Array, " d"]
    """Coordinates of the twin's own parameters and of the effects'."""
    left: float
    """Mean square of what is left unexplained there."""
    where: Field | None = None
    """How strongly the effects act on each mass point, 0..1; None: on all alike."""
    promised: float = math.inf
    """Mean square that would have been left before the step, were the plain twin's parameters to follow."""


def searched(
    study: Study, effects: Sequence[Effect], progress: Portion | None = None
) -> dict[EffectName, Begun]:
    """Where a fit of each effect may begin, after a step; what leaves least first.

    Args:
        study: The fitted plain twin.
        effects: To try, all able to act.
        progress: Called with the share that is done.
    """
    tell = progress or (lambda share: None)
    by_name = {name: effect for name in EFFECT_NAMES for effect in effects if effect.name == name}
    places: list[Field] = []
    if not study.dear:
        places = [tensor(place.field) for place in halves_of(study.plain.twin.body.points)]
    seen = side_by_side(
        lambda effect: _looked(study, effect, places if effect.local else []),
        list(by_name.values()),
        lambda done: tell(0.5 * done / len(by_name)),
    )
    looked = dict(zip(by_name, seen, strict=True))
    order = sorted(looked, key=lambda name: looked[name].promised)
    # a given twin may be far from where an effect is right, and what is linear there says little
    stepped = order if study.plain.twin.given else order[:STEPPED]
    begun = side_by_side(
        lambda name: looked[name].begun(study), stepped, lambda done: tell(0.5 + 0.5 * done / len(stepped))
    )
    found = {name: looked[name].everywhere.as_it_is() for name in order}
    found |= zip(stepped, begun, strict=True)
    return {name: found[name] for name in sorted(found, key=lambda name: found[name].left)}


def beginning(
    study: Study,
    effects: tuple[Effect, ...],
    tried: Sequence[Mapping[str, float]],
    where: Field | None = None,
) -> Begun:
    """A step from the strength that promises most; or hardly any of it, where a step from there leaves more.

    Args:
        study: The fitted plain twin.
        effects: One, or two that are at work together.
        tried: Values by `effect.quantity`, each looked at in all strengths; what is not given starts where
            its effect says.
        where: How strongly they act on each mass point, 0..1; None: on all alike.
    """
    return _begun(study, _found(study, effects, tried, where), tried)


@dataclass(frozen=True)
class _Strength:
    """What promises most of all that was tried."""

    misfit: Misfit
    vector: Float64[Array, " d"]
    faint: Float64[Array, " d"]
    """The same with hardly any of the effects."""
    left: float
    """Mean square that is left at the vector."""
    promised: float
    """The same, were the plain twin's parameters to follow linearly."""

    def as_it_is(self) -> Begun:
        """Without a step."""
        return Begun(self.vector, self.left, self.misfit.hypothesis.where, self.promised)


@dataclass(frozen=True)
class _Looked:
    """What was seen of an effect before any step."""

    tried: Sequence[Mapping[str, float]]
    everywhere: _Strength
    half: _Strength | None
    """In the half of the body where it promises most; None: it is not looked for there."""

    @property
    def promised(self) -> float:
        """The less of both."""
        return min(one.promised for one in (self.everywhere, self.half) if one is not None)

    def begun(self, study: Study) -> Begun:
        """After a step; in a half only, if a step from there leaves much less.

        What puts one half right and acts on all alike makes the other as wrong: it is faint then, or explains
        nothing.
        """
        there = _begun(study, self.everywhere, self.tried)
        if self.half is None or self.half.promised >= self.everywhere.promised:
            return there
        placed = _begun(study, self.half, self.tried)
        return placed if placed.left < HALF * there.left else there


def _looked(study: Study, effect: Effect, places: Sequence[Field]) -> _Looked:
    """An effect in all strengths, and in some of them in each of these places."""
    tried = named_probes(study, effect)
    everywhere = _found(study, (effect,), tried)
    placed = [_found(study, (effect,), tried, where, IN_PLACES) for where in places]
    return _Looked(tried, everywhere, min(placed, key=lambda one: one.promised, default=None))


def _found(
    study: Study,
    effects: tuple[Effect, ...],
    tried: Sequence[Mapping[str, float]],
    where: Field | None = None,
    strengths: Sequence[float] = STRENGTHS,
) -> _Strength:
    """Which strength of what is tried promises most, where effects act on all alike or in a place."""
    misfit = study.misfit.of(replace(study.plain, effects=effects, where=where))
    every = known(misfit, study.base.values, tried)
    able = affordable(misfit, every, strengths)
    starts = _vectors(misfit, able)
    eased = [(one, _beside(misfit, start)) for one, start in zip(able, starts, strict=True)]
    beside = [(one, there) for one, there in eased if there is not None]
    able += [one for one, _ in beside]
    starts = np.stack([*starts, *(there for _, there in beside)])
    residuals = misfit(starts)
    promised = _linearly_left(study, residuals)
    best = int(promised.argmin())
    faint = strong(misfit, able[best].values, (FAINT,) * len(effects))
    left = float((residuals[best] ** 2).mean())
    return _Strength(misfit, starts[best], faint, left, float(promised[best]) / misfit.size)


def _begun(study: Study, found: _Strength, tried: Sequence[Mapping[str, float]]) -> Begun:
    """A step from there; or hardly any of it, where a step leaves more."""
    misfit = found.misfit
    misfit.settle()
    there = _stepped(misfit, found.vector)
    if study.plain.twin.given:
        there = _as_given(study, misfit, tried, there)
    left = float((misfit(found.faint[None])[0] ** 2).mean())
    best = there if there.left < left else Begun(found.faint, left)
    return replace(best, where=misfit.hypothesis.where, promised=found.promised)


def _as_given(study: Study, misfit: Misfit, tried: Sequence[Mapping[str, float]], there: Begun) -> Begun:
    """A step from what a given twin came with, where that leaves less: all it lacks may be the effect.

    The plain twin was fitted without it, and may have ended far from parameters that were right.
    """
    starts = _vectors(misfit, affordable(misfit, known(misfit, study.start, tried)))
    misfit.settle()
    left = (misfit(starts) ** 2).mean(1)
    if left.min() >= there.left:
        return there
    misfit.settle()
    return _stepped(misfit, starts[int(left.argmin())])


def known(
    misfit: Misfit, own: Mapping[str, float], tried: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Values of all quantities, those of the twin as its own, for each that is tried."""
    first = {name: quantity.start for name, quantity in misfit.hypothesis.quantities.items()}
    return [{**first, **own, **values} for values in tried]


class Start(NamedTuple):
    """What is tried of effects."""

    factors: tuple[float, ...]
    """So many times as strong, each of the effects."""
    values: Mapping[str, float]
    """Of all quantities, by name."""


def affordable(
    misfit: Misfit, every: Sequence[Mapping[str, float]], strengths: Sequence[float] = STRENGTHS
) -> list[Start]:
    """Each of these in all strengths, from faint to strong, less what needs much finer steps in time.

    Args:
        misfit: Of the hypothesis that has the effects.
        every: Values of all its quantities; those of the twin's own are the same in each.
        strengths: Faintest first.
    """
    count = len(misfit.hypothesis.effects)
    tried = [Start(each, values) for each in product(strengths, repeat=count) for values in every]
    most = DEAREST * misfit.needs(strong(misfit, every[0], (0.0,) * count))
    return [tried[one] for one in misfit.within(_vectors(misfit, tried), most)]


def _vectors(misfit: Misfit, starts: Sequence[Start]) -> Float64[Array, "s d"]:
    """Coordinates of each."""
    return np.stack([strong(misfit, start.values, start.factors) for start in starts])


def _beside(misfit: Misfit, vector: Float64[Array, " d"]) -> Float64[Array, " d"] | None:
    """The same with the twin's own parameters as they would be beside such effects; None: as they are."""
    values = misfit.coordinates.values(vector)
    factors: dict[str, float] = {}
    for effect in misfit.hypothesis.effects:
        own = {name: values[f"{effect.name}.{name}"] for name in effect.quantities}
        for name, factor in effect.beside(own).items():
            factors[name] = factors.get(name, 1.0) * factor
    if not factors:
        return None
    other = misfit.coordinates.vector({**values, **{n: by * values[n] for n, by in factors.items()}})
    clipped: Float64[Array, " d"] = np.clip(other, *misfit.coordinates.bounds)
    return clipped


def strong(misfit: Misfit, values: Mapping[str, float], factors: Sequence[float]) -> Float64[Array, " d"]:
    """Coordinates of values, with each effect so many times as strong.

    Args:
        misfit: Of the hypothesis that has the effects.
        values: Of all its quantities, by name.
        factors: One for each effect.
    """
    amplitudes = [[f"{effect.name}.{name}" for name in effect.absent] for effect in misfit.hypothesis.effects]
    each = zip(factors, amplitudes, strict=True)
    return misfit.coordinates.vector(
        {**values, **{name: by * values[name] for by, own in each for name in own}}
    )


def _linearly_left(study: Study, left: Float64[Array, "s m"]) -> Float64[Array, " s"]:
    """Sums of squares, were the plain twin's parameters to follow linearly."""
    slopes = left @ study.base.jacobian
    explained = (slopes * np.linalg.solve(_normal(study.base.jacobian), slopes.T).T).sum(1)
    squares: Float64[Array, " s"] = (left**2).sum(1) - explained
    return squares


def _stepped(misfit: Misfit, start: Float64[Array, " d"]) -> Begun:
    """After one Gauss-Newton step of all coordinates; where it was, if no share of the step leaves less."""
    low, high = misfit.coordinates.bounds
    jacobian = misfit.jacobian(start, STEPS[0])
    step = np.linalg.solve(_normal(jacobian), -jacobian.T @ misfit(start[None])[0])
    tried = np.clip(start + np.outer((0.0, *SHARES), step), low, high)
    squares = (misfit(tried) ** 2).mean(1)
    best = int(squares.argmin())
    return Begun(tried[best], float(squares[best]))


def values_of(study: Study, effect: Effect, start: Begun) -> dict[str, float]:
    """The effect's own values where a fit may begin, by `effect.quantity`."""
    misfit = study.misfit.of(replace(study.plain, effects=(effect,)))
    known = misfit.coordinates.values(start.vector)
    return {name: value for name, value in known.items() if name not in study.plain.quantities}


def _normal(jacobian: Float64[Array, "m d"]) -> Float64[Array, "d d"]:
    normal: Float64[Array, "d d"] = jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / LOOSE**2
    return normal


def named_probes(study: Study, effect: Effect) -> list[dict[str, float]]:
    """What is tried of an effect, by `effect.quantity`: along the body, the same however it is turned."""
    angle = heading(study.plain.twin.body.points)
    tried = (effect.turned(values, angle) for values in probes(effect))
    return [{f"{effect.name}.{name}": value for name, value in values.items()} for values in tried]
