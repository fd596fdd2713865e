"""Fit a twin with effects as long as the plain one is fitted, and judge both by what no fit has seen."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.stats import t as student

from model.gap.acts_on import Acting
from model.gap.blocks import block_length, blocks_of, correlation_time, independent_share, jackknife
from model.gap.coordinates import Coordinates
from model.gap.effects.base import Effect, Field
from model.gap.estimate import Estimate, estimate
from model.gap.forecast import Forecast, forecast
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit
from model.gap.search import FAINT, strong
from model.gap.study import STEPS, Study
from model.gap.world import World
from model.types import Array

PROMISING, FURTHER = 0.9, 12
"""A fit that leaves less than this share of what the plain twin does is followed for so many steps more."""
FREEDOM = 4.0
"""Degrees of freedom of the innovations' distribution: its tails are those of a few lost points."""
EDGE = 0.01
"""A value is at its bound within this share of the way between its bounds."""


@dataclass(frozen=True)
class Fitted:
    """A twin, with or without effects, and what it foretells."""

    misfit: Misfit
    estimate: Estimate
    foretold: Forecast
    """Of the frames that no fit has seen."""

    @property
    def hypothesis(self) -> Hypothesis:
        """Whose quantities were fitted."""
        return self.misfit.hypothesis

    @property
    def world(self) -> World:
        """With the fitted values."""
        return self.hypothesis.at(self.estimate.values)


@dataclass(frozen=True)
class Confirmed(Fitted):
    """A twin with effects, compared with the plain one."""

    evidence: float
    """Log-score of the held-out frames over that of the refitted plain twin [nats]."""
    intervals: dict[str, tuple[float, float]]
    """95 % intervals of the effects' quantities, by `effect.quantity`."""
    at_bound: tuple[str, ...]
    """Quantities of the effects that the fit drove to a bound: absurdly much of it, or nothing at all."""


def refit(study: Study, also: Mapping[str, float] | None = None) -> Fitted:
    """The plain twin after as many more steps, from its own best fit, as any effect gets on top of that fit.

    Without such a round of its own it would lose to whatever is merely optimised for longer.

    Args:
        study: The plain twin's first fit.
        also: Values of its own parameters in the fit of an effect that has found another valley: if it is
            deeper without the effect as well, that explains nothing.
    """
    found = further(study, fitted(study, study.plain, study.base.vector))
    if also is None:
        return found
    other = fitted(study, study.plain, study.misfit.coordinates.vector(also))
    if other.estimate.cost < found.estimate.cost / PROMISING:
        other = further(study, other)
    return min(found, other, key=lambda one: one.estimate.cost)


def confirm(
    study: Study,
    plain: Fitted,
    effects: tuple[Effect, ...],
    start: Float64[Array, " d"],
    where: Field | None = None,
    anew: Estimate | None = None,
) -> Confirmed:
    """Fit the twin's own parameters and those of effects together.

    Args:
        study: The plain twin's first fit, from which this one starts.
        plain: What `refit` made of it: the one to be beaten.
        effects: One, or two that are at work together.
        start: Coordinates of the twin's own parameters and the effects' (`search`).
        where: How strongly they act on each mass point, 0..1; None: on all alike.
        anew: Of the same twin, begun elsewhere (`afresh`); None: there is none.
    """
    hypothesis = replace(study.plain, effects=effects, where=where)
    found = fitted(study, hypothesis, start)
    if anew is not None and anew.cost < found.estimate.cost:
        found = min(found, fitted(study, hypothesis, anew.vector), key=lambda one: one.estimate.cost)
    if found.estimate.cost > plain.estimate.cost:
        # the plain twin has gone on since the search: who is still in a valley that it left explains nothing
        found = min(found, _from(plain, study, found.misfit, start), key=lambda one: one.estimate.cost)
    if found.estimate.cost < PROMISING * plain.estimate.cost:
        found = further(study, found)
    own = [name for name in found.estimate.values if name not in study.plain.quantities]
    return Confirmed(
        found.misfit,
        found.estimate,
        found.foretold,
        evidence(study, plain.foretold, found.foretold),
        intervals(study, found, own),
        at_bound(found, own),
    )


def _from(plain: Fitted, study: Study, misfit: Misfit, start: Float64[Array, " d"]) -> Fitted:
    """Fitted from where the refitted plain twin ended, with hardly any of the effects."""
    values = {**misfit.coordinates.values(start), **plain.estimate.values}
    faint = strong(misfit, values, (FAINT,) * len(misfit.hypothesis.effects))
    return fitted(study, misfit.hypothesis, np.clip(faint, *misfit.coordinates.bounds))


def localised(study: Study, plain: Fitted, everywhere: Confirmed, place: Acting) -> Confirmed:
    """One effect fitted again where it acts, if that is another part of the object and leaves less.

    Args:
        study: The plain twin's first fit.
        plain: What `refit` made of it.
        everywhere: The effect on all alike, or where a search has found it.
        place: Where it was found to act.
    """
    if place.where is None or place.where is everywhere.hypothesis.where:
        return everywhere
    (effect,) = everywhere.hypothesis.effects
    misfit = study.misfit.of(replace(everywhere.hypothesis, where=place.where))
    factors = (1.0, place.scale**0.5, place.scale)
    starts = np.stack([strong(misfit, everywhere.estimate.values, (by,)) for by in factors])
    start = starts[int((misfit(starts) ** 2).mean(1).argmin())]
    local = confirm(study, plain, (effect,), start, place.where)
    return local if local.estimate.cost < everywhere.estimate.cost else everywhere


def fitted(
    study: Study,
    hypothesis: Hypothesis,
    start: Float64[Array, " d"],
    steps: int = STEPS,
    *,
    slopes: bool = True,
    most: int | None = None,
) -> Fitted:
    """From a start near a fitted plain twin, over all frames at once, in as many steps as any fit gets.

    Growing horizons are for who starts far away: from here they lead astray as often as they help, and the
    fit would no longer be sure to end at least as well as it began.
    """
    misfit = study.misfit.of(hypothesis)
    misfit = study.in_time(misfit) if most is None else misfit.giving_up(most)
    found = estimate(misfit, start[None], steps, study.split, slopes=slopes)
    return Fitted(misfit, found, forecast(study.observer, hypothesis.at(found.values), study.split))


def further(study: Study, found: Fitted) -> Fitted:
    """The same after more steps from where it ended; as it was where these lead to nothing better.

    The way to an effect's strength leads along a valley in which the twin's own parameters make up for it:
    this recording hardly tells how far it is, but another one does.
    """
    more = fitted(study, found.hypothesis, found.estimate.vector, FURTHER)
    return more if more.estimate.cost < found.estimate.cost else found


def held_out(study: Study, foretold: Forecast) -> float:
    """Mean square of its innovations in the frames that no fit has seen [m²]."""
    seen = study.observer.seen.numpy()[study.split :]
    innovations = foretold.innovations[study.split :]
    return float((innovations[seen] ** 2).mean()) if seen.any() else 0.0


def evidence(study: Study, plain: Forecast, other: Forecast) -> float:
    """By how many nats one forecast of the held-out frames is likelier than another.

    Innovations of the observer are scored by a Student distribution, its scale taken from the frames that the
    fit saw. They hang together in time and among points, so the sum counts only for the share of them that
    is independent: of the innovations that are smaller over the frames that the fit saw.

    Reference:
        Gneiting and Raftery (2007), Strictly proper scoring rules, prediction, and estimation, Journal of the
        American statistical association 102, section 4.1 (the logarithmic score).
    """
    seen = study.observer.seen.numpy()
    past, held = slice(1, study.split), slice(study.split, None)
    scales = [_scale(one.innovations[past][seen[past]]) for one in (plain, other)]
    scores = [
        _log_score(one.innovations[held][seen[held]], scale)
        for one, scale in zip((plain, other), scales, strict=True)
    ]
    calmer = plain if scales[0] <= scales[1] else other
    return (scores[1] - scores[0]) * independent_share(calmer.innovations[past], seen[past])


def _log_score(errors: Float64[Array, "m 3"], scale: float) -> float:
    return float(student.logpdf(errors, FREEDOM, scale=scale).sum())


def _scale(errors: Float64[Array, "m 3"]) -> float:
    """Of the Student distribution that fits errors [m] best."""
    square, power = errors**2, max(float((errors**2).mean()), 1e-12)
    for _ in range(30):
        power = float(((FREEDOM + 1.0) * square / (FREEDOM + square / power)).mean())
    return float(np.sqrt(power))


def intervals(study: Study, fitted: Fitted, names: list[str]) -> dict[str, tuple[float, float]]:
    """95 % intervals of fitted quantities: a jackknife over blocks of time of the linearised fit.

    Blocks are about as long as residuals remember, so that what the model cannot express widens the intervals
    like noise does. What is wrong alike at all times, as another lattice, they cannot tell. It is there where
    a twin leaves more than noise, and intervals are wider by as much as that is more, in standard deviations
    (`benchmarks/gap/true_effect.py` says how many then hold the truth).
    """
    found, frames = fitted.estimate, study.frame_of_residuals()
    field = study.residuals(found)
    length = block_length(study.split - 1, round(2.0 * correlation_time(field, study.seen)))
    block = blocks_of(frames, length)
    parts = [(found.jacobian[block == b], found.residuals[block == b]) for b in range(block.max() + 1)]
    normals = np.stack([jacobian.T @ jacobian for jacobian, _ in parts])
    slopes = np.stack([jacobian.T @ residuals for jacobian, residuals in parts])
    belief = found.belief
    spread = np.sqrt(np.diag(jackknife(normals, slopes, belief.precision, belief.scatter)))
    reach = float(student.ppf(0.975, len(parts) - 1) * np.sqrt(max(found.cost, 1.0))) * spread
    coordinates = fitted.misfit.coordinates
    low, high = (_within(coordinates, found.vector + sign * reach) for sign in (-1.0, 1.0))
    return {name: (low[name], high[name]) for name in names}


def _within(coordinates: Coordinates, vector: Float64[Array, " d"]) -> dict[str, float]:
    return coordinates.values(np.clip(vector, *coordinates.bounds))


def at_bound(fitted: Fitted, names: list[str]) -> tuple[str, ...]:
    """Which of these quantities ended at a bound."""
    low, high = fitted.misfit.coordinates.bounds
    margin = EDGE * (high - low)
    vector = fitted.estimate.vector
    ended = (vector < low + margin) | (vector > high - margin)
    return tuple(
        name
        for name, is_there in zip(fitted.misfit.coordinates.names, ended, strict=True)
        if is_there and name in names
    )
