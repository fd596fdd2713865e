"""What another recording of an object suggests of an effect that the first hardly shows.

What is missing is missing in both, as strong, but one may show plainly what the other hides: a grip that
slips a little while a rope is lifted passes for a hand that is elsewhere, and where the rope is pulled out of
it for nothing else.
"""

from dataclasses import dataclass

from model.gap.effects.base import Effect, Field
from model.gap.meeting import able_effects
from model.gap.search import beginning, named_probes, values_of
from model.gap.study import Study
from model.schema import EffectName

PROMISING = 0.9
"""An effect that leaves more than this share of what the plain twin does, a step from where either is,
suggests nothing."""


@dataclass(frozen=True)
class Elsewhere:
    """Another recording, and what explains it."""

    study: Study
    """The plain twin, fitted to it."""
    able: tuple[Effect, ...]
    """That can act in it."""
    left: float
    """Mean square that the plain twin leaves there, a step further."""

    @classmethod
    def of(cls, study: Study) -> "Elsewhere":
        """The plain twin takes a step as well: what it gains by that no effect explains."""
        return cls(study, tuple(able_effects(study)), beginning(study, (), [{}]).left)

    def suggests(self, name: EffectName, where: Field | None = None) -> dict[str, float] | None:
        """Values by `effect.quantity`, a step from where they promise most; None: none do, or it cannot act.

        Args:
            name: Of the effect.
            where: How strongly it acts on each mass point, 0..1; None: on all alike.
        """
        for effect in self.able:
            if effect.name == name:
                begun = beginning(self.study, (effect,), named_probes(self.study, effect), where)
                enough = begun.left < PROMISING * self.left
                return values_of(self.study, effect, begun) if enough else None
        return None
