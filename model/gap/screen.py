"""What could explain a gap, before any effect is fitted: score tests, a jury, and where fits may begin."""

from collections.abc import Mapping
from dataclasses import dataclass

from model.gap.classifier import Jury
from model.gap.effects.base import Effect
from model.gap.elsewhere import Elsewhere
from model.gap.evidence import Evidence, gather
from model.gap.meeting import able_effects
from model.gap.schema import EFFECT_NAMES
from model.gap.search import Begun, searched
from model.gap.signs import Signs, signs_of
from model.gap.stages import Progress, within
from model.gap.study import Study
from model.gap.transfer import Transferred
from model.gap.verdict import Judged, judged
from model.schema import EffectName


@dataclass(frozen=True)
class Screened:
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


def screen(fitted: Study, other: Transferred | None, tell: Progress) -> Screened:
    """Ask of every effect that can act, in both recordings if there are two."""
    tell("screen", 0.1)
    able = able_effects(fitted)
    evidence = gather(fitted, able, within(tell, "screen", 0.1, 0.13))
    elsewhere = None if other is None else Elsewhere.of(other.study(fitted))
    if elsewhere is not None:
        shown = gather(elsewhere.study, elsewhere.able, within(tell, "screen", 0.16, 0.19))
        evidence = evidence.joined(shown)
    shape, ground = fitted.plain.twin.body.shape, fitted.observation.ground_height is not None
    signs = signs_of(evidence, shape, fitted.base.cost, ground)
    begins = searched(fitted, able, within(tell, "screen", 0.2, 0.3))
    effects = {name: effect for name in EFFECT_NAMES for effect in able if effect.name == name}
    return Screened(effects, evidence, signs, judged(Jury.shipped(), signs), begins, elsewhere)
