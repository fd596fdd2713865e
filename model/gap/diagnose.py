"""The order of a diagnosis: fit the plain twin, ask what could explain the gap, confirm it, say how far."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from model.gap.account import Account, Explained, against_ordinary
from model.gap.acts_on import acting
from model.gap.ceiling import ceiling
from model.gap.classifier import Jury
from model.gap.closure import closure
from model.gap.closure import transfer as closed_there
from model.gap.confirm import Confirmed, Fitted, confirm, held_out, localised, refit
from model.gap.diagnosis import Diagnosis
from model.gap.effects.base import Effect
from model.gap.evidence import Evidence, gather
from model.gap.forecast import Forecast, forecast
from model.gap.found import Found, Tried
from model.gap.joint import fitted_jointly
from model.gap.locate import locate
from model.gap.meeting import able_effects
from model.gap.plain import PlainTwin
from model.gap.schema import EFFECT_NAMES
from model.gap.search import Begun, beginning, searched, values_of
from model.gap.signs import Signs, signs_of
from model.gap.size import size_of
from model.gap.study import Study, study
from model.gap.transfer import Followed, Transferred, transferred
from model.gap.verdict import Judged, judged, second_of
from model.gap.weighing import Weighing
from model.one_thread import one_thread
from model.schema import EffectName
from model.simulator.kernel.threads import kernel_threads, usable_cores
from model.simulator.pace import StabilityWarning
from model.types import Observation

LIKELIEST, EXPLAINING = 1, 4
"""Effects that are fitted: the jury's likeliest, and those that explain most after a step."""
SEEN = 0.98
"""An effect that leaves more than this share of what the plain twin does is not there to be seen."""
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
        transfer: Another interaction with the same object, the same points tracked.
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


def _diagnosed(
    observation: Observation, twin: PlainTwin | None, transfer: Observation | None, tell: Progress
) -> Diagnosis:
    tell("refit", 0.0)
    fitted = study(observation, twin)
    other = None if transfer is None else transferred(fitted, transfer)
    screened = _screened(fitted, other, tell)
    tell("confirm", 0.6)
    plain = refit(fitted)
    confirmed = {name: _fitted(fitted, plain, screened, name) for name in _likely(screened)}
    refitted = None if other is None else other.forecast(plain.hypothesis, plain.estimate.values)
    account = _account(fitted, other, plain, confirmed, screened.first, refitted)
    tried = _tried(fitted, plain, confirmed, screened, account)
    tell("ceiling", 0.85)
    flexible = ceiling(fitted, plain)
    tell("where", 0.92)
    there = None
    if other is not None and refitted is not None:
        there = closed_there(fitted, other, refitted, tried.chosen, flexible)
    here = closure(fitted, plain, tried.chosen, flexible)
    found = Found(fitted, plain, tried, screened.signs, screened.evidence, locate(fitted), here, there)
    tell("report", 0.97)
    return Diagnosis(found.findings(), found.records(), found.own_values(), tried.account)


def _screened(fitted: Study, other: Transferred | None, tell: Progress) -> _Screened:
    tell("screen", 0.15)
    able = able_effects(fitted)
    evidence = gather(fitted, able, lambda share: tell("screen", 0.15 + 0.1 * share))
    if other is not None:
        again = other.study(fitted)
        shown = gather(again, able_effects(again), lambda share: tell("screen", 0.25 + 0.1 * share))
        evidence = evidence.joined(shown)
    shape, ground = fitted.plain.twin.body.shape, fitted.observation.ground_height is not None
    signs = signs_of(evidence, shape, fitted.base.cost, ground)
    begins = searched(fitted, able, lambda share: tell("screen", 0.35 + 0.25 * share))
    effects = {name: effect for name in EFFECT_NAMES for effect in able if effect.name == name}
    return _Screened(effects, evidence, signs, judged(Jury.shipped(), signs), begins)


def _fitted(fitted: Study, plain: Fitted, screened: _Screened, name: EffectName) -> Confirmed:
    return confirm(fitted, plain, (screened.effects[name],), screened.begins[name].vector)


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
    place = acting(fitted, confirmed[best].estimate, effects[best])
    if both is not None:
        return Tried(verdict, confirmed, second, both, place, account)
    confirmed[best] = localised(fitted, plain, confirmed[best], place)
    return Tried(verdict, confirmed, None, confirmed[best], place, account)


def _likely(screened: _Screened) -> list[EffectName]:
    """Those that the jury ranks first, and those that leave least after a step."""
    begins = screened.begins
    ranked = [name for name in screened.first.ranked if name in begins][:LIKELIEST]
    return list(dict.fromkeys([*ranked, *list(begins)[:EXPLAINING]]))


def _account(
    fitted: Study,
    other: Transferred | None,
    plain: Fitted,
    confirmed: Mapping[EffectName, Confirmed],
    screened: Judged,
    refitted: Forecast | None,
) -> Account:
    """What each effect explains: in the frames of its fit, in later ones, and in another recording.

    One that explains nothing in the frames of its fit is not tried anywhere else: there is no strength to try
    it with.
    """
    here, later = plain.estimate.cost, held_out(fitted, plain.foretold)
    # as many steps more as an effect gets in both recordings
    elsewhere = None if other is None else other.further(other.followed(plain))
    explained: dict[EffectName, Explained] = {}
    shared: dict[EffectName, Explained] = {}
    for name, one in confirmed.items():
        if one.estimate.cost >= SEEN * here:
            explained[name] = shared[name] = Explained()
            continue
        left = (here, one.estimate.cost), (later, held_out(fitted, one.foretold))
        if other is None or elsewhere is None:
            explained[name] = Explained.of(*left)
            continue
        held = other.followed(one)
        explained[name] = Explained.of(*left, (elsewhere.estimate.cost, held.estimate.cost))
        shared[name] = _shared(fitted, other, one, (plain, elsewhere), held) or Explained.of(*left)
    lefts, noises = [here], [fitted.misfit.noise]
    if other is not None and elsewhere is not None:
        lefts, noises = [here, elsewhere.estimate.cost], [fitted.misfit.noise, other.told_noise]
    return Account(
        fitted.plain.twin.body.shape,
        {name: screened.chances[name] for name in EFFECT_NAMES},
        explained,
        {} if other is None else shared,
        _astray(plain, refitted),
        tuple(against_ordinary(*one) for one in zip(lefts, noises, strict=True)),
    )


def _shared(
    fitted: Study, other: Transferred, one: Fitted, plain: tuple[Fitted, Followed], held: Followed
) -> Explained | None:
    """What an effect explains that is as strong in both recordings; None: it cannot act in the other."""
    both = fitted_jointly(one, plain, other, held)
    if both is None:
        return None
    later = forecast(fitted.observer, one.hypothesis.at(both.values), fitted.split)
    without = (plain[0].estimate.cost, held_out(fitted, plain[0].foretold), plain[1].estimate.cost)
    return Explained.of(
        (without[0], both.left[0]), (without[1], held_out(fitted, later)), (without[2], both.left[1])
    )


def _astray(plain: Fitted, there: Forecast | None) -> tuple[float, ...]:
    """How far off the refitted twin's free runs are in each recording, over the size of the object."""
    size = size_of(plain.world.system.points.double().numpy())
    runs = [plain.foretold, *([] if there is None else [there])]
    return tuple(one.error / size for one in runs)
