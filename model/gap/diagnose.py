"""The order of a diagnosis: fit the plain twin, ask what could explain the gap, confirm it, say how far."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import chain

from model.gap.account import Account
from model.gap.accounting import account_of
from model.gap.acts_on import acting
from model.gap.afresh import afresh
from model.gap.bodies.guess import Shape
from model.gap.ceiling import ceiling
from model.gap.classifier import Jury
from model.gap.closure import closure
from model.gap.closure import transfer as closed_there
from model.gap.confirm import Confirmed, Fitted, confirm, localised, refit
from model.gap.diagnosis import Diagnosis
from model.gap.effects.base import Effect
from model.gap.elsewhere import Elsewhere
from model.gap.estimate import Estimate
from model.gap.evidence import Evidence, gather
from model.gap.found import Found, Tried
from model.gap.locate import locate
from model.gap.meeting import able_effects
from model.gap.plain import PlainTwin
from model.gap.schema import EFFECT_NAMES
from model.gap.search import Begun, beginning, searched, values_of
from model.gap.side_by_side import side_by_side
from model.gap.signs import Signs, signs_of
from model.gap.study import DEAR, Study, study
from model.gap.transfer import Transferred, transferred
from model.gap.verdict import Judged, judged, second_of
from model.gap.weighing import Weighing
from model.one_thread import one_thread
from model.schema import EffectName
from model.simulator.kernel.threads import kernel_threads, usable_cores
from model.simulator.pace import StabilityWarning
from model.types import Observation

FITTED: Mapping[Shape, int] = {"rope": 5, "sheet": 4, "solid": 5}
"""So many effects."""
FITTED_DEAR = 3
"""At most, where rollouts take long."""
LABORIOUS: Mapping[Shape, float] = {"rope": DEAR, "sheet": 1e7, "solid": DEAR}
"""Work of a rollout from which on that is so: fits of sheets take twice as long as others."""
BETTER = 0.95
"""Two effects are named where together they leave less than this share of what one leaves."""

Progress = Callable[[str, float], None]


def diagnose(
    observation: Observation,
    twin: PlainTwin | None = None,
    transfer: Observation | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Where a twin departs from what was observed, which effect it lacks, and how far the gap shrinks.

    Args:
        observation: What really moved.
        twin: What it is compared with; None: made from the observation.
        transfer: Another interaction with the same object, the same points tracked or others.
        progress: Told what is done next and what share of the whole is done.

    Raises:
        InputError: nothing can be built of the observation, or `transfer` is of something else.
    """
    # two threads of torch are slower than one for tensors this small; the many worlds of a fit share out well
    with kernel_threads(usable_cores()), one_thread(), warnings.catch_warnings():
        # substeps are the observer's choice, the same for all worlds of a fit; users can do nothing about it
        warnings.simplefilter("ignore", StabilityWarning)
        return _diagnosed(observation, twin, transfer, progress or (lambda stage, share: None))


@dataclass(frozen=True)
class _Screened:
    """What could explain the gap, before any effect is fitted."""

    effects: Mapping[EffectName, Effect]
    """Those that can act."""
    evidence: Evidence
    signs: Signs
    first: Judged
    """What the jury believes."""
    begins: Mapping[EffectName, Begun]
    """Where a fit of each may begin; what leaves least first."""
    elsewhere: Elsewhere | None
    """The other recording; None: there is none."""


def _diagnosed(
    observation: Observation, twin: PlainTwin | None, transfer: Observation | None, tell: Progress
) -> Diagnosis:
    tell("refit", 0.0)
    fitted = study(observation, twin)
    other = None if transfer is None else transferred(fitted, transfer)
    screened = _screened(fitted, other, tell)
    plain, confirmed, flexible = _confirmed(fitted, screened, tell)
    tell("weigh", 0.75)
    refitted = None if other is None else other.forecast(plain.hypothesis, plain.estimate.values)
    account = account_of(fitted, other, plain, confirmed, screened.first, refitted)
    tried = _tried(fitted, plain, confirmed, screened, account)
    tell("where", 0.92)
    there = None
    if other is not None and refitted is not None:
        there = closed_there(fitted, other, refitted, tried.chosen, flexible)
    here = closure(fitted, plain, tried.chosen, flexible)
    found = Found(
        fitted, plain, tried, screened.signs, screened.evidence, locate(fitted, plain.estimate), here, there
    )
    tell("report", 0.97)
    return Diagnosis(found.findings(), found.records(), found.own_values(), tried.account)


def _within(tell: Progress, stage: str, begin: float, end: float) -> Callable[[float], None]:
    """Tells the share of a part of a stage, which goes from `begin` to `end` of the whole."""
    return lambda share: tell(stage, begin + (end - begin) * share if share < 1.0 else end)


def _screened(fitted: Study, other: Transferred | None, tell: Progress) -> _Screened:
    tell("screen", 0.1)
    able = able_effects(fitted)
    evidence = gather(fitted, able, _within(tell, "screen", 0.1, 0.13))
    elsewhere = None if other is None else Elsewhere.of(other.study(fitted))
    if elsewhere is not None:
        shown = gather(elsewhere.study, elsewhere.able, _within(tell, "screen", 0.16, 0.19))
        evidence = evidence.joined(shown)
    shape, ground = fitted.plain.twin.body.shape, fitted.observation.ground_height is not None
    signs = signs_of(evidence, shape, fitted.base.cost, ground)
    begins = searched(fitted, able, _within(tell, "screen", 0.2, 0.3))
    effects = {name: effect for name in EFFECT_NAMES for effect in able if effect.name == name}
    return _Screened(effects, evidence, signs, judged(Jury.shipped(), signs), begins, elsewhere)


def _afresh(fitted: Study, screened: _Screened, name: EffectName) -> Estimate:
    effects, where, elsewhere = (screened.effects[name],), screened.begins[name].where, screened.elsewhere
    shown = None if elsewhere is None else elsewhere.suggests(name, where)
    return afresh(fitted, replace(fitted.plain, effects=effects, where=where), shown)


def _refitted(fitted: Study, anew: Mapping[EffectName, Estimate]) -> Fitted:
    """The plain twin, that begins also where the best of these fits has ended, without its effect.

    Not one that was given: it came with parameters, and is not led away from them by an effect.
    """
    if fitted.plain.twin.given or not anew:
        return refit(fitted)
    best = min(anew.values(), key=lambda one: one.cost)
    return refit(fitted, {name: best.values[name] for name in fitted.base.values})


def _confirmed(
    fitted: Study, screened: _Screened, tell: Progress
) -> tuple[Fitted, dict[EffectName, Confirmed], Fitted]:
    """The refitted plain twin, the same with each of the likely effects, and with a flexible force."""
    tell("confirm", 0.3)
    likely = _likely(screened.begins, screened.first, fitted)
    first, then = _within(tell, "confirm", 0.3, 0.48), _within(tell, "confirm", 0.5, 0.75)
    anew = side_by_side(
        lambda name: _afresh(fitted, screened, name), likely, lambda done: first(done / len(likely))
    )
    plain = _refitted(fitted, dict(zip(likely, anew, strict=True)))

    def fit(one: tuple[EffectName, Estimate] | None) -> Fitted:
        return ceiling(fitted, plain) if one is None else _fitted(fitted, plain, screened, *one)

    # the flexible force takes longest, and comes first
    parts = [None, *zip(likely, anew, strict=True)]
    flexible, *fits = side_by_side(fit, parts, lambda done: then(done / len(parts)))
    confirmed = [one for one in fits if isinstance(one, Confirmed)]
    return plain, dict(zip(likely, confirmed, strict=True)), flexible


def _fitted(
    fitted: Study, plain: Fitted, screened: _Screened, name: EffectName, anew: Estimate | None = None
) -> Confirmed:
    begun = screened.begins[name]
    return confirm(fitted, plain, (screened.effects[name],), begun.vector, begun.where, anew)


def _tried(
    fitted: Study,
    plain: Fitted,
    confirmed: dict[EffectName, Confirmed],
    screened: _Screened,
    account: Account,
) -> Tried:
    verdict = Weighing.shipped().judged(account)
    best = verdict.effect
    if best is None:
        return Tried(verdict, confirmed, None, None, None, account)
    effects, begins = screened.effects, screened.begins
    if best not in confirmed:
        confirmed[best] = _fitted(fitted, plain, screened, best)
    second = second_of(verdict, screened.signs, screened.evidence)
    both = None
    if second is not None and second != best:
        values = {**confirmed[best].estimate.values, **values_of(fitted, effects[second], begins[second])}
        pair = effects[best], effects[second]
        both = confirm(fitted, plain, pair, beginning(fitted, pair, [values]).vector)
        alone = min(confirmed[best].foretold.error, plain.foretold.error)
        if both.foretold.error >= BETTER * alone or both.evidence <= confirmed[best].evidence:
            both = None
    one = confirmed[best]
    place = acting(fitted, one.estimate, effects[best], one.hypothesis.where)
    if both is not None:
        return Tried(verdict, confirmed, second, both, place, account)
    confirmed[best] = localised(fitted, plain, confirmed[best], place)
    return Tried(verdict, confirmed, None, confirmed[best], place, account)


def _likely(begins: Mapping[EffectName, Begun], first: Judged, fitted: Study) -> list[EffectName]:
    """The jury's first, then in turn those that promise most and those that leave least after a step.

    Where the plain twin has made up for what it lacks, no step from there leads to what is right, and what
    little is left after one says less than what was promised.
    """
    shape = fitted.plain.twin.body.shape
    most = FITTED_DEAR if fitted.work > LABORIOUS[shape] else FITTED[shape]
    ranked = [name for name in first.ranked if name in begins][:1]
    promising = sorted(begins, key=lambda name: begins[name].promised)
    in_turn = chain.from_iterable(zip(promising, begins, strict=True))
    return list(dict.fromkeys([*ranked, *in_turn]))[:most]
