"""An effect fitted to two recordings of an object at once: as strong in both, all else as in each alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.confirm import Fitted
from model.gap.estimate import Misfit, Residuals, descended
from model.gap.search import FAINT, strong
from model.gap.study import STEPS
from model.gap.transfer import Followed, Transferred
from model.types import Array

WEAKER = (1.0, 0.5, 0.25)
"""Of the strength in the first recording, of which it may tell little: where a fit may begin."""
AGAIN, DIVISIONS = 1.1, 2
"""A twin that leaves more than so many times what it left when it was fitted is lost to its time steps: these
are halved so often at most."""


class Joint(Residuals):
    """Innovations of two recordings, each over what is taken for its noise.

    A vector has the effect's coordinates first, then those of the twin's own parameters in the first
    recording, then in the other.

    Args:
        misfits: With the same effect, of both recordings.
        left: Mean squares, over those of the sensor, that are noise to a fit: what no twin explains.
    """

    def __init__(self, misfits: tuple[Misfit, Misfit], left: tuple[float, float]) -> None:
        """See the class."""
        self._misfits, self._scales = misfits, tuple(float(one) ** -0.5 for one in left)
        names = [misfit.coordinates.names for misfit in misfits]
        alike = [name for name in names[0] if _of_effect(name)]
        if alike != [name for name in names[1] if _of_effect(name)]:
            raise ValueError(f"{names[0]} and {names[1]} are not of the same effect")
        own = [[name for name in each if not _of_effect(name)] for each in names]
        self._count = len(alike) + len(own[0]) + len(own[1])
        begins = len(alike), len(alike) + len(own[0])
        self._places: tuple[Int64[Array, " k"], ...] = tuple(
            np.array([(alike.index(n) if n in alike else begin + mine.index(n)) for n in each])
            for each, mine, begin in zip(names, own, begins, strict=True)
        )

    @property
    def bounds(self) -> tuple[Float64[Array, " d"], Float64[Array, " d"]]:
        """Lower and upper, of each coordinate."""
        low, high = (self.vector(*(misfit.bounds[side] for misfit in self._misfits)) for side in (0, 1))
        return low, high

    def vector(self, here: Float64[Array, " h"], there: Float64[Array, " t"]) -> Float64[Array, " d"]:
        """Of the coordinates in both recordings; the effect's are those of the first."""
        vector = np.empty(self._count)
        for places, own in zip(reversed(self._places), (there, here), strict=True):
            vector[places] = own
        return vector

    def of_each(self, vector: Float64[Array, " d"]) -> tuple[Float64[Array, " h"], Float64[Array, " t"]]:
        """The coordinates in each recording."""
        here, there = (vector[places] for places in self._places)
        return here, there

    def left(self, residuals: Float64[Array, " m"]) -> tuple[float, float]:
        """Mean squares in each recording, over those of its sensor's noise."""
        first = self._misfits[0].size
        here, there = (
            float(np.mean((part / scale) ** 2))
            for part, scale in zip((residuals[:first], residuals[first:]), self._scales, strict=True)
        )
        return here, there

    def __call__(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Of the first recording, then of the other, one row for each vector."""
        each = zip(self._misfits, self._places, self._scales, strict=True)
        return np.concatenate([scale * misfit(vectors[:, places]) for misfit, places, scale in each], axis=1)

    def jacobian(self, vector: Float64[Array, " d"], width: float) -> Float64[Array, "m d"]:
        """Slopes; a parameter that is one recording's own is nothing to the other."""
        rows = []
        for misfit, places, scale in zip(self._misfits, self._places, self._scales, strict=True):
            slopes = scale * misfit.jacobian(vector[places], width)
            rows.append(np.zeros((len(slopes), self._count)))
            rows[-1][:, places] = slopes
        return np.concatenate(rows)


@dataclass(frozen=True)
class Jointly:
    """Twins with an effect that is as strong in both recordings."""

    values: Mapping[str, float]
    """In the first recording."""
    left: tuple[float, float]
    """Mean square of what is left unexplained in each, over the sensor's noise."""


def fitted_jointly(
    one: Fitted, plain: tuple[Fitted, Followed], other: Transferred, there: Followed
) -> Jointly | None:
    """An effect in both recordings at once, from where it is in the first; None: it cannot act in the other.

    What the first recording hardly tells of an effect the other may tell: held as strong as the first asks
    for, what is really missing did harm there as often as not. What the effect leaves in each recording, free
    in the first and held in the other, counts as its noise: the first order of a likelihood whose noise is
    what remains. Of some places to begin the likeliest is followed.

    Args:
        one: Fitted to the first recording.
        plain: Twins without effects, fitted to each recording.
        other: The other recording.
        there: `one` in the other recording, its effect as strong as in the first.
    """
    hypothesis = other.hypothesis(one.hypothesis)
    if len(hypothesis.effects) < len(one.hypothesis.effects):
        return None
    here, again = one.misfit, other.misfit(hypothesis)
    joint = Joint((here, again), (one.estimate.cost, min(there.estimate.cost, plain[1].estimate.cost)))
    found = dict(one.estimate.values)
    count = len(one.hypothesis.effects)

    def beginning(by: float, *own: Mapping[str, float]) -> Float64[Array, " d"]:
        each = zip((here, again), own, strict=True)
        return joint.vector(*(strong(misfit, {**found, **known}, (by,) * count) for misfit, known in each))

    starts = [beginning(by, found, there.estimate.values) for by in WEAKER]
    starts.append(beginning(FAINT, *(each.estimate.values for each in plain)))
    for misfit, known in ((here, one.estimate), (again, there.estimate)):
        _settled(misfit, misfit.coordinates.vector({**found, **known.values}), known.cost)
    low, high = joint.bounds
    tried = np.clip(np.stack(starts), low + 1e-6, high - 1e-6)
    begin = min(zip(tried, joint(tried), strict=True), key=lambda pair: _unlikely(joint.left(pair[1])))[0]
    result = descended(joint, begin, begin, STEPS)
    return Jointly(
        here.coordinates.values(joint.of_each(result.x)[0]), joint.left(result.fun[: -len(result.x)])
    )


def _settled(misfit: Misfit, vector: Float64[Array, " d"], left: float) -> None:
    """Time divided as finely as a twin needs that was fitted before: from there a fit would not find back."""
    for _ in range(DIVISIONS):
        if float((misfit(vector[None]) ** 2).mean()) <= AGAIN * left:
            break
        misfit.divide()


def _unlikely(left: tuple[float, float]) -> float:
    return float(np.log(left).sum())


def _of_effect(name: str) -> bool:
    return "." in name
