"""Fits of an effect that begin anywhere, as those of the plain twin do: not only from where that ended.

Where an effect is really at work the plain twin has made up for it, and its own parameters are wrong. From
there the way to what is right may be uphill: a rope that sticks to the ground is followed by a slack one that
hardly sticks, and any more of it makes that worse.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from model.gap.bodies.guess import Shape
from model.gap.effects.base import Effect
from model.gap.estimate import Estimate, estimate
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit
from model.gap.search import STRENGTHS, affordable, known, named_probes, strong
from model.gap.study import STEPS, Study, quarter_of, starts_of
from model.types import Array

TIMES: Mapping[Shape, int] = {"rope": 8, "sheet": 4, "solid": 4}
"""So often each place where a fit of the plain twin may begin is looked at, with other strengths of the
effect; what has many springs takes longer, and is looked at once where rollouts take long."""
FOLLOWED: Mapping[Shape, int] = {"rope": 2, "sheet": 1, "solid": 2}
"""Of all that is looked at, where rollouts do not take long; of two one is faint and one strong."""


def afresh(study: Study, hypothesis: Hypothesis, suggested: Mapping[str, float] | None = None) -> Estimate:
    """The best of fits that begin at places all around, in all strengths.

    Args:
        study: The fitted plain twin.
        hypothesis: With one effect.
        suggested: Values of the effect's own, by `effect.quantity`, that another recording suggests: a fit
            begins with them too, and with the plain twin's; None: it suggests none.
    """
    (effect,) = hypothesis.effects
    misfit = study.in_time(study.misfit.of(hypothesis))
    starts, strength = _starts(study, misfit, effect)
    left = (misfit(starts) ** 2).mean(1)
    quarter = quarter_of(misfit)
    found = []
    count = 1 if study.dear else FOLLOWED[study.plain.twin.body.shape]
    places = [starts[one] for one in _followed(left, strength, count)]
    if suggested is not None:
        places += [misfit.coordinates.vector({**study.base.values, **suggested})]
    for place in places:
        misfit.settle()
        found.append(estimate(misfit, place[None], STEPS, quarter, slopes=False))
    return min(found, key=lambda one: one.cost)


def _starts(
    study: Study, misfit: Misfit, effect: Effect
) -> tuple[Float64[Array, "s d"], Float64[Array, " s"]]:
    """Coordinates of where to look, and how strong the effect is there, softest twins first.

    Stiff ones need finer steps in time, and so does all that is looked at after them.
    """
    own = starts_of(study.misfit, study.start)
    times = 1 if study.dear else TIMES[study.plain.twin.body.shape]
    tried = affordable(misfit, known(misfit, study.base.values, named_probes(study, effect)))
    # each in turn, in an order that has nothing to do with that of the places
    turns = np.random.default_rng(0).permutation(np.arange(times * len(own)) % len(tried))
    starts: list[Float64[Array, " d"]] = []
    strength: list[float] = []
    for turn, vector in zip(turns, np.repeat(own, times, axis=0), strict=True):
        factors, values = tried[turn]
        starts.append(strong(misfit, {**values, **study.misfit.coordinates.values(vector)}, factors))
        strength += factors
    stacked, stiffness = np.stack(starts), misfit.coordinates.names.index("stiffness")
    softest = np.argsort(stacked[:, stiffness], kind="stable")
    return stacked[softest], np.array(strength)[softest]


def _followed(left: Float64[Array, " s"], strength: Float64[Array, " s"], count: int) -> Sequence[int]:
    """Which to follow: the best of all, or the best of the faint and of the strong ones, if any."""
    if count == 1:
        return [int(left.argmin())]
    faint = strength < np.median(STRENGTHS)
    return [int(np.where(part, left, np.inf).argmin()) for part in (faint, ~faint) if part.any()]
