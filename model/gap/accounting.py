"""How the account of a diagnosis is made: what is left with each effect, and without it."""

from collections.abc import Mapping

from jaxtyping import Float64

from model.gap.account import Account, Explained, against_ordinary
from model.gap.confirm import Fitted, held_out
from model.gap.forecast import forecast
from model.gap.joint import fitted_jointly
from model.gap.lattices import lattices_of, left_here, left_there
from model.gap.schema import EFFECT_NAMES
from model.gap.side_by_side import side_by_side
from model.gap.slowly import explained_slowly, left_slowly
from model.gap.study import Study
from model.gap.transfer import Transferred
from model.gap.verdict import Judged
from model.schema import EffectName
from model.types import Array

SEEN = 0.98
"""An effect that leaves more than this share of what the plain twin does is not there to be seen."""
SHARED = 0.1
"""One that explains fewer e-folds in the first recording is not fitted to both: what it explains in the other
counts at most as much as that, and each such fit takes as long as the first."""


def account_of(
    fitted: Study,
    other: Transferred | None,
    plain: Fitted,
    confirmed: Mapping[EffectName, Fitted],
    screened: Judged,
    flexible: Fitted,
) -> Account:
    """What each fitted effect explains, what any could, and how much there is to explain.

    Args:
        fitted: The first recording.
        other: The other one; None: there is none.
        plain: From `confirm.refit`.
        confirmed: Effects, fitted to the first recording.
        screened: What score tests say.
        flexible: From `ceiling`.
    """
    cost, later = plain.estimate.cost, held_out(fitted, plain.foretold)
    slowly = left_slowly(plain.misfit, plain.estimate.values)
    explained = {name: explained_by(one, fitted, plain, slowly) for name, one in confirmed.items()}
    shared: dict[EffectName, Explained] = {}
    left = [against_ordinary(cost, fitted.misfit.noise)]
    values = plain.estimate.values
    others = lattices_of(fitted)
    lattices = [left_here(others, plain.misfit, values)]
    if other is not None:
        # as many rounds as an effect gets there: to be followed, and from hardly any of it to be shared
        there = other.further(other.further(other.followed(plain)))
        slowly_there = left_slowly(there.misfit, there.estimate.values)
        shared.update(explained)
        worth = {name: max(explained[name].fitted, explained[name].slowly) for name in confirmed}
        tried = [name for name in confirmed if worth[name] > SHARED]
        fits = side_by_side(lambda name: fitted_jointly(confirmed[name], plain, other, there), tried)
        for name, both in zip(tried, fits, strict=True):
            if both is None:
                continue
            one = confirmed[name]
            foretold = forecast(fitted.observer, one.hypothesis.at(both.values), fitted.split)
            shared[name] = Explained.of(
                (cost, both.left[0]),
                (later, held_out(fitted, foretold)),
                (there.estimate.cost, both.left[1]),
                (explained_slowly(slowly, both.slowly[0]), explained_slowly(slowly_there, both.slowly[1])),
            )
        left.append(against_ordinary(there.estimate.cost, other.told_noise))
        lattices.append(left_there(others, fitted, other, values, there))
    return Account(
        fitted.plain.twin.body.shape,
        {name: screened.chances[name] for name in EFFECT_NAMES},
        explained,
        shared,
        tuple(left),
        explained_by(flexible, fitted, plain, slowly),
        tuple(lattices),
    )


def explained_by(one: Fitted, fitted: Study, plain: Fitted, slowly: Float64[Array, " k"]) -> Explained:
    """What is explained of the first recording by an effect or a flexible force that was fitted to it.

    Args:
        one: The twin with it.
        fitted: The recording.
        plain: The twin without it, from `confirm.refit`.
        slowly: What that leaves (`left_slowly`).
    """
    cost = plain.estimate.cost
    if one.estimate.cost >= SEEN * cost:
        return Explained()
    after = left_slowly(one.misfit, one.estimate.values)
    return Explained.of(
        (cost, one.estimate.cost),
        (held_out(fitted, plain.foretold), held_out(fitted, one.foretold)),
        slowly=(explained_slowly(slowly, after),),
    )
