"""From what fits explain to what is believed: a conditional logit over {none, each effect, unknown}."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from model.gap.account import LEAST, Account, Explained
from model.gap.classifier import NONE, UNKNOWN
from model.gap.schema import EFFECT_NAMES, VerdictName
from model.gap.slowly import BLOCKS
from model.gap.verdict import Judged
from model.schema import EffectName

WEIGHTS = "weighing.json"
IMPOSSIBLE = 1e-9
"""What score tests believe no more of than this cannot act here, and is never the answer."""
BUCKLES, SLACK = ("rope", "sheet"), "tension_only"
"""What is thin folds between the points of its twin. One that cannot, a rope's or one that was given, is too
stiff against being pressed together: slack springs explain that, healthy or not."""
RESIDUE, WIDTH = 1.61, 0.57
"""Where nothing is missing a plain twin leaves so much, over the noise, and as much again as it leaves of
itself on other lattices, give or take so many powers of e: of development worlds
(`python -m benchmarks.gap.weighing`), as below.
"""
HEALTHY = {"rope": (0.77, 0.51), "sheet": (1.61, 0.92), "solid": (0.82, 0.48)}
"""Of the logarithm of what a plain twin leaves where nobody knows what other lattices would: the median, and
as a width the standard deviation of a normal distribution with the same quartiles.
"""
MOST_BEYOND = (-1.0, 4.0)
"""Widths that what is left in a recording counts at most as fewer or more."""
WITHIN: Mapping[EffectName, EffectName] = {"gravity_tilt": "wind", "viscoelasticity": "plasticity"}
"""What the second of them can be like with a quantity more. A wind that is strong and pulls little pushes
alike everywhere and at all times, as a tilt does; what yields at no strain, slowly, and hardens relaxes as a
viscous branch does."""
WITHIN_IN: Mapping[str, Mapping[EffectName, EffectName]] = {"rope": {"bending_stiffness": "plasticity"}}
"""The same in bodies of a shape alone: a rope whose bends never yield is an elastic rod."""
SIMPLER = 0.5 * float(np.log(2 * BLOCKS))
"""Nats by which the simpler of such two is likelier where it explains as much, if both were fitted; together
they are believed as much as without: half the logarithm of the blocks of time of two recordings."""
SLIGHT = 0.2
"""E-folds by which a flexible force may explain more than any effect: it does where nothing is missing."""


@dataclass(frozen=True)
class Weighing:
    """Weights of a conditional logit; the score of "none" is zero where as much is left as usual.

    An effect that explains nothing has by `effect` another score than none, as have those that were not worth
    a fit.

    Reference:
        McFadden (1974), Conditional logit analysis of qualitative choice behavior, Frontiers in Econometrics;
        Schwarz (1978), Estimating the dimension of a model, Annals of Statistics 6, of one in another.
    """

    effect: float
    """Of every effect."""
    fitted: float
    """For each e-fold that is explained in the frames of the fit."""
    later: float
    elsewhere: float
    slowly: float
    """For each e-fold that a slow observer sees explained."""
    slowly_elsewhere: float
    harm: float
    """On top of that where it is less than nothing: as strong in both recordings, what is really missing does
    no harm in either, and what is not often does in one."""
    buckling: float
    """Of slack springs in what is thin."""
    unknown: float
    """Of something that is not in the catalogue."""
    left: float
    """Against none, and against each effect, for each width that the twin, with the effect, leaves more than
    healthy ones do: with what it lacks it is as good as they are. Something unknown has to leave nothing."""
    flexible: float
    """Of something unknown, for the share of what a force explains which may be any missing physics that no
    effect of the catalogue explains as well."""

    @classmethod
    def shipped(cls) -> "Weighing":
        """The one that comes with the package."""
        return cls(**json.loads(files("model.gap").joinpath(WEIGHTS).read_text())["weights"])

    def judged(self, account: Account) -> Judged:
        """What is believed after effects were fitted.

        Those that were not share what is left to them as score tests say.
        """
        scores = self.scores(account)
        most = max(scores.values())
        chances = {name: float(np.exp(score - most)) for name, score in scores.items()}
        pairs = nested(account.shape)
        for other in {other for other in pairs.values() if other in account.told}:
            simple = [name for name, within in pairs.items() if within == other and name in account.told]
            before = chances[other] + sum(chances[name] for name in simple)
            chances |= {name: float(np.exp(SIMPLER)) * chances[name] for name in simple}
            after = chances[other] + sum(chances[name] for name in simple)
            chances |= {name: before / max(after, IMPOSSIBLE) * chances[name] for name in (other, *simple)}
        total = sum(chances.values())
        return Judged({name: chance / total for name, chance in chances.items()})

    def scores(self, account: Account) -> dict[VerdictName, float]:
        """Of all answers: linear in the weights."""
        scores: dict[VerdictName, float] = {}
        scores.update(self._fitted(account).items())
        untried = [name for name in EFFECT_NAMES if name not in scores]
        whole = sum(account.screened[name] for name in untried)
        none = -self.left * beyond(account)
        for name in untried:
            share = account.screened[name] / whole if whole > IMPOSSIBLE else 0.0
            scores[name] = none + self.effect + float(np.log(max(share * len(untried), IMPOSSIBLE)))
        strange = self.unknown + self.flexible * unexplained(account)
        return scores | {NONE: none, UNKNOWN: strange}

    def _fitted(self, account: Account) -> Mapping[EffectName, float]:
        thin = account.shape in BUCKLES
        surely = {name: surely_explained(account, one) for name, one in account.told.items()}
        return {
            name: self.effect
            + self.fitted * one.fitted
            + self.later * one.later
            + self.elsewhere * one.elsewhere
            + self.slowly * one.slowly
            + self.slowly_elsewhere * one.slowly_elsewhere
            + self.harm * min(one.elsewhere, 0.0)
            - self.left * beyond(account, account.told[name])
            + (self.buckling if thin and name == SLACK else 0.0)
            for name, one in surely.items()
        }


def nested(shape: str) -> Mapping[EffectName, EffectName]:
    """Effects and what else can be like them, in a body of this shape."""
    return {**WITHIN, **WITHIN_IN.get(shape, {})}


def unexplained(account: Account) -> float:
    """Share of what a flexible force explains, but for `SLIGHT`, that no effect explains as well.

    In the frames of the fit and as a slow observer sees them together; 0 where nobody asked.
    """
    if account.flexible is None:
        return 0.0
    force = surely_explained(account, account.flexible)
    sure = (surely_explained(account, one) for one in account.explained.values())
    most = max((one.fitted + one.slowly for one in sure), default=0.0)
    there = force.fitted + force.slowly
    return max(there - max(most, 0.0) - SLIGHT, 0.0) / max(there, SLIGHT)


def surely_explained(account: Account, explained: Explained) -> Explained:
    """What is explained for sure: as much as the twin leaves of itself on other lattices is left by chance.

    Where L is left without an effect, M with it and D of other lattices, the e-folds ln(L / M) count as
    ln((L + D) / (M + D)): as they are where all lattices go alike, as next to nothing where D is most of L.
    """
    known = (*account.lattices, None, None)
    here, there = (
        0.0 if lattices is None else lattices / max(left, LEAST)
        for lattices, left in zip(known, (*account.left, LEAST)[:2], strict=False)
    )

    def sure(e_folds: float, share: float) -> float:
        return float(np.log((1.0 + share) / (np.exp(-e_folds) + share)))

    return Explained(
        fitted=sure(explained.fitted, here),
        later=sure(explained.later, here),
        elsewhere=sure(explained.elsewhere, there),
        slowly=sure(explained.slowly, here),
        slowly_elsewhere=sure(explained.slowly_elsewhere, there),
    )


def beyond(account: Account, explained: Explained | None = None) -> float:
    """Widths by which a twin leaves more than healthy ones do, within `MOST_BEYOND`: of all recordings alike.

    Args:
        account: What the plain twin leaves.
        explained: How much less of that is left with an effect; None: of the plain twin.
    """
    less = (0.0, 0.0) if explained is None else (explained.fitted, explained.elsewhere)
    left = [np.log(max(one, LEAST)) - by for one, by in zip(account.left, less, strict=False)]
    known = account.lattices or (None,) * len(left)
    median, width = np.transpose([usual(account.shape, lattices) for lattices in known])
    return float(np.clip((np.array(left) - median) / width, *MOST_BEYOND).mean())


def usual(shape: str, lattices: float | None) -> tuple[float, float]:
    """Of the logarithm of what a plain twin leaves where nothing is missing: the median and the width.

    Args:
        shape: Of the object.
        lattices: What the twin leaves of itself on other lattices; None: that is not known.
    """
    if lattices is None:
        return HEALTHY[shape]
    return float(np.log(RESIDUE + lattices)), WIDTH
