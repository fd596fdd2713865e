"""Nothing moves any more: the shape last seen stays."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float32

from model.evaluation.baselines.base import Method, PartBelief
from model.evaluation.baselines.seen import last_seen
from model.scenes.case import Case
from model.types import Array, Parameters


class HoldLast(Method):
    """Each point stays where it was last seen: what must be beaten by anything that knows of motion.

    Of an interaction of which nothing was seen, the rest shape is all that there is to hold. Frame 0 is
    given, and matches points with truths: it is the rest shape in any case.
    """

    name: ClassVar[str] = "hold-last"
    version: ClassVar[str] = "3"

    def fit(self, case: Case) -> "Held":
        """Remember the shape last seen."""
        return Held(case.name, last_seen(case))


@dataclass(frozen=True)
class Held:
    """A shape that stays."""

    case: str
    """Of which case it is."""
    shape: Float32[Array, "N 3"]
    """[m]."""
    parameters: Parameters | None = None
    part_belief: PartBelief | None = None

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """The shape in every frame after the first [m]."""
        shape = self.shape if case.name == self.case else case.rest
        held = np.repeat(shape[None], len(case.observation.times), axis=0)
        held[0] = case.rest
        return held
