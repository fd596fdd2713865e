"""How the account of a diagnosis is made: what is left with each effect, and without it."""

from collections.abc import Mapping

from model.gap.account import Account, Explained, against_ordinary
from model.gap.confirm import Fitted, held_out
from model.gap.forecast import Forecast, forecast
from model.gap.joint import fitted_jointly
from model.gap.schema import EFFECT_NAMES
from model.gap.size import size_of
from model.gap.study import Study
from model.gap.transfer import Followed, Transferred
from model.gap.verdict import Judged
from model.schema import EffectName

SEEN = 0.98
"""An effect that leaves more than this share of what the plain twin does is not there to be seen."""


def account_of(
    fitted: Study,
    other: Transferred | None,
    plain: Fitted,
    confirmed: Mapping[EffectName, Fitted],
    screened: Judged,
    refitted: Forecast | None,
) -> Account:
    """What each fitted effect explains, and where the plain twin is lost.

    One that explains nothing in the frames of its fit is not tried anywhere else: there is no strength to try
    it with.

    Args:
        fitted: The first recording.
        other: The other one; None: there is none.
        plain: From `confirm.refit`.
        confirmed: Effects, fitted to the first recording.
        screened: What score tests say.
        refitted: What `plain` foretells in the other recording.
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
