"""From what fits explain to what is believed: a conditional logit over {none, each effect, unknown}."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from model.gap.account import Account
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
HEALTHY = {"rope": (0.74, 0.38), "sheet": (1.43, 0.83), "solid": (0.92, 0.74)}
"""Mean and standard deviation of the logarithm of what a plain twin leaves, over the noise, where nothing is
missing, of development worlds (`python -m benchmarks.gap.weighing train`): no lattice is the world."""
MOST_BEYOND = (-1.0, 2.5)
"""Standard deviations that what is left counts at most as fewer or more."""
WITHIN: Mapping[EffectName, EffectName] = {"gravity_tilt": "wind", "viscoelasticity": "plasticity"}
"""What the second of them can be like with a quantity more. A wind that is strong and pulls little pushes
alike everywhere and at all times, as a tilt does; what yields at no strain, slowly, and hardens relaxes as a
viscous branch does."""
SIMPLER = 0.5 * float(np.log(2 * BLOCKS))
"""Nats by which the simpler of such two is likelier where it explains as much, if both were fitted; together
they are believed as much as without: half the logarithm of the blocks of time of two recordings."""
SLIGHT = 0.2
"""E-folds by which a flexible force may explain more than any effect: it does where nothing is missing."""
ASTRAY, ASTRAY_STEP, MOST_ASTRAY = 0.04, 0.01, (-4.0, 8.0)
"""Share of the object's size from which it counts that free runs are off, in which steps, within limits."""


@dataclass(frozen=True)
class Weighing:
    """Weights of a conditional logit; the score of "none" is zero where as much is left as usual.

    An effect that explains nothing has the score `effect`, as have those that were not worth a fit.

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
    sheet: float
    """On top of all parts, of sheets, whose plain twins are worse."""
    buckling: float
    """Of slack springs in what is thin."""
    unknown: float
    """Of something that is not in the catalogue."""
    astray: float
    """Of the same, for each step that free runs are off in the better followed of the recordings: a fold or a
    fall, nearly chaotic, leads a healthy twin astray in one; what is missing is missing in all."""
    left: float
    """Against none, for each standard deviation that the plain twin leaves more than healthy ones do."""
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
        for simple, other in WITHIN.items():
            if not {simple, other} <= set(account.told):
                continue
            both = chances[simple] + chances[other]
            chances[simple] *= float(np.exp(SIMPLER))
            share = both / max(chances[simple] + chances[other], IMPOSSIBLE)
            chances |= {name: share * chances[name] for name in (simple, other)}
        total = sum(chances.values())
        return Judged({name: chance / total for name, chance in chances.items()})

    def scores(self, account: Account) -> dict[VerdictName, float]:
        """Of all answers: linear in the weights."""
        scores: dict[VerdictName, float] = {}
        scores.update(self._fitted(account).items())
        untried = [name for name in EFFECT_NAMES if name not in scores]
        whole = sum(account.screened[name] for name in untried)
        for name in untried:
            share = account.screened[name] / whole if whole > IMPOSSIBLE else 0.0
            scores[name] = self.effect + float(np.log(max(share * len(untried), IMPOSSIBLE)))
        off = float(np.clip((min(account.astray) - ASTRAY) / ASTRAY_STEP, *MOST_ASTRAY))
        strange = self.unknown + self.astray * off + self.flexible * unexplained(account)
        return scores | {NONE: -self.left * beyond(account), UNKNOWN: strange}

    def _fitted(self, account: Account) -> Mapping[EffectName, float]:
        extra = self.sheet if account.shape == "sheet" else 0.0
        thin = account.shape in BUCKLES
        return {
            name: self.effect
            + (self.fitted + extra) * one.fitted
            + (self.later + extra) * one.later
            + (self.elsewhere + extra) * one.elsewhere
            + (self.slowly + extra) * one.slowly
            + (self.slowly_elsewhere + extra) * one.slowly_elsewhere
            + self.harm * min(one.elsewhere, 0.0)
            + (self.buckling if thin and name == SLACK else 0.0)
            for name, one in account.told.items()
        }


def unexplained(account: Account) -> float:
    """Share of what a flexible force explains, but for `SLIGHT`, that no effect explains as well.

    In the frames of the fit and as a slow observer sees them together; 0 where nobody asked.
    """
    force = account.flexible
    if force is None:
        return 0.0
    most = max((one.fitted + one.slowly for one in account.explained.values()), default=0.0)
    there = force.fitted + force.slowly
    return max(there - max(most, 0.0) - SLIGHT, 0.0) / max(there, SLIGHT)


def beyond(account: Account) -> float:
    """Standard deviations of healthy twins by which more is left than they leave, within `MOST_BEYOND`.

    In the recording that is followed better: a fold or a fall leads a healthy twin astray in one.
    """
    mean, spread = HEALTHY[account.shape]
    left = float(np.log(max(min(account.left), 1e-12)))
    return float(np.clip((left - mean) / spread, *MOST_BEYOND))
