"""The order of a diagnosis: fit the plain twin, ask what could explain the gap, confirm it, say how far."""

import warnings

from model.gap.account import Account
from model.gap.accounting import account_of
from model.gap.acts_on import acting
from model.gap.closure import closure
from model.gap.closure import transfer as closed_there
from model.gap.confirm import confirm, localised
from model.gap.contest import Contest, contested, fitted_with
from model.gap.diagnosis import Diagnosis
from model.gap.found import Found, Tried
from model.gap.guessed_twin import guessed_twin
from model.gap.locate import locate
from model.gap.plain import PlainTwin
from model.gap.posed_by_shape import FoldedOtherwiseError
from model.gap.screen import Screened, screen
from model.gap.search import beginning, values_of
from model.gap.stages import Progress
from model.gap.study import Study, study
from model.gap.transfer import Transferred, transferred
from model.gap.verdict import second_of
from model.gap.weighing import Weighing
from model.one_thread import one_thread
from model.simulator.kernel.threads import kernel_threads, usable_cores
from model.simulator.pace import StabilityWarning
from model.types import Observation

BETTER = 0.95
"""Two effects are named where together they leave less than this share of what one leaves."""


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


def _diagnosed(
    observation: Observation, twin: PlainTwin | None, transfer: Observation | None, tell: Progress
) -> Diagnosis:
    tell("refit", 0.0)
    fitted = study(observation, twin or guessed_twin(observation, transfer))
    other = None if transfer is None else _another(fitted, transfer)
    screened = screen(fitted, other, tell)
    contest = contested(fitted, screened, tell)
    plain, flexible = contest.plain, contest.flexible
    tell("weigh", 0.75)
    account = account_of(fitted, other, plain, contest.confirmed, screened.first, flexible)
    tried = _tried(fitted, contest, screened, account)
    tell("where", 0.92)
    there = None
    if other is not None:
        refitted = other.forecast(plain.hypothesis, plain.estimate.values)
        there = closed_there(fitted, other, refitted, tried.chosen, flexible)
    here = closure(fitted, plain, tried.chosen, flexible)
    found = Found(
        fitted, plain, tried, screened.signs, screened.evidence, locate(fitted, plain.estimate), here, there
    )
    tell("report", 0.97)
    return Diagnosis(found.findings(), found.records(), found.own_values(), tried.account)


def _another(fitted: Study, transfer: Observation) -> Transferred | None:
    """The other recording; None, and a warning: it cannot be told where the object's points are there."""
    try:
        return transferred(fitted, transfer)
    except FoldedOtherwiseError as error:
        warnings.warn(
            f"the other recording is left out, and the verdict is of the first alone: {error}; if it is the "
            "same object, give a recording that begins with the cloth spread out, or track the same points",
            stacklevel=3,
        )
        return None


def _tried(fitted: Study, contest: Contest, screened: Screened, account: Account) -> Tried:
    verdict = Weighing.shipped().judged(account)
    best, plain, confirmed = verdict.effect, contest.plain, dict(contest.confirmed)
    if best is None:
        return Tried(verdict, confirmed, None, None, None, account)
    effects, begins = screened.effects, screened.begins
    if best not in confirmed:
        confirmed[best] = fitted_with(fitted, plain, screened, best)
    first = confirmed[best].world
    second = second_of(verdict, screened.signs, screened.evidence, effects, first)
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
