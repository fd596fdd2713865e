"""The prior's motion, moved to where the object was last seen."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float32
from scipy.spatial import cKDTree

from model.evaluation.baselines.base import Fitted, Method, PartBelief
from model.evaluation.baselines.prior_mean import PriorMean
from model.evaluation.baselines.seen import Seen, across
from model.scenes.case import Case
from model.types import Array, Parameters

RECENT = 5
"""A residual is taken from the last sighting within so many frames before the split."""
AROUND = 3
"""Neighbours that lend their residual to a point that was not seen of late."""


class LastResidual(Method):
    """The prior-mean twin, and from the split on what it missed in the last frame seen, point by point.

    A fit may gain its whole advantage from being near the truth when the future begins; this baseline has
    that advantage for nothing. Of an interaction of which nothing was seen there is no residual.
    """

    name: ClassVar[str] = "last-residual"

    def fit(self, case: Case) -> "Shifted":
        """Take the residuals of the last frames before the split."""
        twin = PriorMean().fit(case)
        return Shifted(case.name, twin, residuals(case, twin.predict(case)), case.split)


@dataclass(frozen=True)
class Shifted:
    """A prediction with a constant offset of each point from some frame on."""

    case: str
    """Whose residuals they are."""
    inner: Fitted
    residual: Float32[Array, "N 3"]
    """[m]."""
    begin: int
    """First frame that is moved."""

    @property
    def parameters(self) -> Parameters | None:
        """Of what is moved."""
        return self.inner.parameters

    @property
    def part_belief(self) -> PartBelief | None:
        """Of what is moved."""
        return self.inner.part_belief

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """What is moved, and moved where residuals are known [m]."""
        points = self.inner.predict(case)
        if case.name != self.case:
            return points
        moved = points.copy()
        moved[self.begin :] += self.residual
        return moved


def residuals(case: Case, predicted: Float32[Array, "T N 3"]) -> Float32[Array, "N 3"]:
    """Seen minus predicted at the last sighting of each point before the split [m].

    With one camera, across its lines of sight. Points not seen of late take the mean of their neighbours;
    where nothing was seen of late, zero.
    """
    seen = Seen.of(case)
    made = torch.as_tensor(predicted[: case.split])
    missed = across(seen.points - made, seen.sight).numpy()
    found = np.zeros((len(case.rest), 3), np.float32)
    known = np.zeros(len(case.rest), bool)
    for frame in range(max(1, case.split - RECENT), case.split):
        there = seen.there[frame].numpy()
        found[there], known = missed[frame][there], known | there
    if known.any() and not known.all():
        count = min(AROUND, int(known.sum()))
        near = cKDTree(case.rest[known]).query(case.rest[~known], count)[1].reshape(-1, count)
        found[~known] = found[known][near].mean(axis=1)
    return found
