"""Which effects are fitted: the likely ones, and more of them where those explain little of what could be.

A screen is sometimes wrong about what is worth a fit. What a force that may be anything explains is there to
be explained; where no fitted effect explains half of that, the next likely ones are fitted as well. A twin
that lacks nothing, or an effect that was found, costs no more than before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from model.gap.account import e_folds
from model.gap.afresh import afresh
from model.gap.bodies.guess import Shape
from model.gap.ceiling import ceiling
from model.gap.confirm import Confirmed, Fitted, confirm, refit
from model.gap.estimate import Estimate
from model.gap.screen import Screened
from model.gap.search import Begun
from model.gap.side_by_side import side_by_side
from model.gap.stages import Portion, Progress, within
from model.gap.study import DEAR, Study
from model.gap.verdict import Judged
from model.gap.weighing import WITHIN_IN
from model.schema import EffectName

FITTED: Mapping[Shape, int] = {"rope": 5, "sheet": 4, "solid": 5}
"""So many effects at first, and as many again if they explain too little and rollouts are quick."""
FITTED_DEAR = 3
"""At most, where rollouts take long."""
LABORIOUS: Mapping[Shape, float] = {"rope": DEAR, "sheet": 1e7, "solid": DEAR}
"""Work of a rollout from which on that is so: fits of sheets take twice as long as others."""
QUICK = 3e6
"""Work of a rollout up to which there is time for a second round: a diagnosis is to take less than three
minutes, and of cloths and solids the first one takes two of them."""
THERE = 0.1
"""E-folds that a flexible force explains of the fitted frames where there is something to be explained:
healthy ropes and solids leave it a few hundredths."""
TOO_LITTLE = 0.5
"""Share of that, of which no effect explains as much."""


@dataclass(frozen=True)
class Contest:
    """What was fitted to the frames that fits see."""

    plain: Fitted
    """The twin without effects."""
    confirmed: Mapping[EffectName, Confirmed]
    """With each of the likely ones."""
    flexible: Fitted
    """With a force that may be any missing physics."""


def explain_too_little(plain: float, force: float, effects: Sequence[float]) -> bool:
    """Whether a force that may be anything explains something, and no effect half as much of it.

    Args:
        plain: Mean square that the plain twin leaves.
        force: That is left with the force.
        effects: That is left with each of the effects.
    """
    left = np.array([force, *effects])
    by_any, *others = e_folds(np.full(len(left), plain), left)
    return bool(by_any > THERE and max(others, default=0.0) < TOO_LITTLE * by_any)


def contested(fitted: Study, screened: Screened, tell: Progress) -> Contest:
    """Fit the plain twin again, a flexible force, and the likely effects, more of them if they must be.

    Args:
        fitted: The plain twin's first fit.
        screened: What could explain the gap.
        tell: Told of the stage `confirm`, from 0.3 to 0.75 of the whole.
    """
    tell("confirm", 0.3)
    order = likely(screened.begins, screened.first)
    shape = fitted.plain.twin.body.shape
    most = FITTED_DEAR if fitted.work > LABORIOUS[shape] else FITTED[shape]
    first = with_simpler(order[:most], order, shape)
    second = with_simpler(order[most : 2 * most], order, shape) if fitted.work <= QUICK else []
    others = [name for name in second if name not in first]
    anew = _anew(fitted, screened, first, within(tell, "confirm", 0.3, 0.42))
    plain = _refitted(fitted, anew)
    contest = _fought(fitted, screened, plain, anew, within(tell, "confirm", 0.42, 0.58))
    costs = [one.estimate.cost for one in contest.confirmed.values()]
    if not others or not explain_too_little(plain.estimate.cost, contest.flexible.estimate.cost, costs):
        return contest
    more = _anew(fitted, screened, others, within(tell, "confirm", 0.58, 0.66))
    again, then = _refitted(fitted, more), within(tell, "confirm", 0.66, 0.75)
    if again.estimate.cost < plain.estimate.cost:
        # what these have found of the plain twin all are to be compared with
        return _fought(fitted, screened, again, anew | more, then)
    late = _fought(fitted, screened, plain, more, then, contest.flexible)
    return replace(contest, confirmed={**contest.confirmed, **late.confirmed})


def likely(begins: Mapping[EffectName, Begun], first: Judged) -> list[EffectName]:
    """The jury's first, then in turn those that promise most and those that leave least after a step.

    Where the plain twin has made up for what it lacks, no step from there leads to what is right, and what
    little is left after one says less than what was promised.
    """
    ranked = [name for name in first.ranked if name in begins][:1]
    promising = sorted(begins, key=lambda name: begins[name].promised)
    in_turn = chain.from_iterable(zip(promising, begins, strict=True))
    return list(dict.fromkeys([*ranked, *in_turn]))


def with_simpler(names: Sequence[EffectName], able: Sequence[EffectName], shape: Shape) -> list[EffectName]:
    """These, and what may be all that is at work where one of them can do as much in such a body, and more.

    From where the plain twin has made up for it, no probe of an elastic rod leaves less than none does, but
    one of a rod that yields may.

    Args:
        names: Of effects that are to be fitted.
        able: Of all that can act.
        shape: Of the body.
    """
    pairs = WITHIN_IN.get(shape, {}).items()
    return list(dict.fromkeys([*names, *(one for one, other in pairs if other in names and one in able)]))


def fitted_with(
    fitted: Study, plain: Fitted, screened: Screened, name: EffectName, anew: Estimate | None = None
) -> Confirmed:
    """The twin with one effect, from where the search or a fit from anywhere has ended."""
    begun = screened.begins[name]
    return confirm(fitted, plain, (screened.effects[name],), begun.vector, begun.where, anew)


def _anew(
    fitted: Study, screened: Screened, names: Sequence[EffectName], tell: Portion
) -> dict[EffectName, Estimate]:
    """Fits of each that begin anywhere."""

    def one(name: EffectName) -> Estimate:
        begun, elsewhere = screened.begins[name], screened.elsewhere
        shown = None if elsewhere is None else elsewhere.suggests(name, begun.where)
        effects = (screened.effects[name],)
        return afresh(fitted, replace(fitted.plain, effects=effects, where=begun.where), shown)

    found = side_by_side(one, names, lambda done: tell(done / len(names)))
    return dict(zip(names, found, strict=True))


def _refitted(fitted: Study, anew: Mapping[EffectName, Estimate]) -> Fitted:
    """The plain twin, that begins also where the best of these fits has ended, without its effect.

    Not one that was given: it came with parameters, and is not led away from them by an effect.
    """
    if fitted.plain.twin.given or not anew:
        return refit(fitted)
    best = min(anew.values(), key=lambda one: one.cost)
    return refit(fitted, {name: best.values[name] for name in fitted.base.values})


def _fought(
    fitted: Study,
    screened: Screened,
    plain: Fitted,
    anew: Mapping[EffectName, Estimate],
    tell: Portion,
    flexible: Fitted | None = None,
) -> Contest:
    """Beside one plain twin: effects that were fitted from anywhere, and the force unless it is known."""

    def fit(name: EffectName | None) -> Fitted:
        return (
            ceiling(fitted, plain) if name is None else fitted_with(fitted, plain, screened, name, anew[name])
        )

    # the flexible force takes longest, and comes first
    parts = [*([] if flexible is not None else [None]), *anew]
    fits = side_by_side(fit, parts, lambda done: tell(done / len(parts)))
    confirmed = [one for one in fits if isinstance(one, Confirmed)]
    force = fits[0] if flexible is None else flexible
    return Contest(plain, dict(zip(anew, confirmed, strict=True)), force)
