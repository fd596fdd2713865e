"""An effect fitted to two recordings of an object at once: as strong in both, all else as in each alone."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.account import LEAST
from model.gap.belief import Belief
from model.gap.confirm import Fitted
from model.gap.estimate import descended
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit, Residuals
from model.gap.search import FAINT, strong
from model.gap.slowly import left_slowly
from model.gap.study import STEPS
from model.gap.transfer import Followed, Transferred
from model.types import Array

WEAKER = (1.0, 0.5, 0.25)
"""Of the strength in the first recording, of which it may tell little: where a fit may begin."""


class Joint(Residuals):
    """Innovations of two recordings, each over what is taken for its noise.

    A vector has the effect's coordinates first, then those of the twin's own parameters in the first
    recording, then in the other.

    Args:
        misfits: With the same effect, of both recordings.
        left: Mean squares, over those of the sensor, that are noise to a fit: what no twin explains.
    """

    def __init__(self, misfits: tuple[Misfit, Misfit], left: tuple[float, float] = (1.0, 1.0)) -> None:
        """See the class."""
        self._misfits = misfits
        # both count alike, however many frames and points each has
        usual = 0.5 * sum(misfit.size for misfit in misfits)
        self._scales = tuple(
            (usual / (misfit.size * max(one, LEAST))) ** 0.5
            for misfit, one in zip(misfits, left, strict=True)
        )
        names = [misfit.coordinates.names for misfit in misfits]
        alike = list(misfits[0].hypothesis.of_effects)
        if alike != list(misfits[1].hypothesis.of_effects):
            raise ValueError(f"{names[0]} and {names[1]} are not of the same effect")
        own = [[name for name in each if name not in alike] for each in names]
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
        here, there = (float(np.mean(part**2)) for part in self._unscaled(residuals))
        return here, there

    def _unscaled(self, residuals: Float64[Array, " m"]) -> tuple[Float64[Array, " h"], Float64[Array, " t"]]:
        """Of each recording, over its sensor's noise."""
        here, there = np.split(residuals, [self._misfits[0].size])
        return here / self._scales[0], there / self._scales[1]

    def __call__(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Of the first recording, then of the other, one row for each vector."""
        each = zip(self._misfits, self._places, self._scales, strict=True)
        return np.concatenate([scale * misfit(vectors[:, places]) for misfit, places, scale in each], axis=1)

    def belief(self, residuals: Float64[Array, " m"], around: Float64[Array, " d"]) -> Belief:
        """Of each recording's own, as much as it counts there; of an effect next to nothing."""
        each = zip(self._misfits, self._unscaled(residuals), self.of_each(around), strict=True)
        here, there = (misfit.belief(left, near) for misfit, left, near in each)
        units = (scale * belief.unit for scale, belief in zip(self._scales, (here, there), strict=True))
        return Belief(
            self.vector(here.centre, there.centre),
            self.vector(here.spread, there.spread),
            self.vector(*units),
        )

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
    slowly: tuple[Float64[Array, " k"], Float64[Array, " k"]]
    """What a slow observer finds left in each, in blocks of time."""


def fitted_jointly(one: Fitted, plain: Fitted, other: Transferred, elsewhere: Followed) -> Jointly | None:
    """An effect in both recordings at once, from where it is in the first; None: it cannot act in the other.

    What the first recording hardly tells of an effect the other may tell: held as strong as the first asks
    for, what is really missing did harm there as often as not. Of some places to begin the likeliest is
    followed. What is left there in each recording counts as its noise: the first order of a likelihood whose
    noise is what remains.

    Args:
        one: Fitted to the first recording.
        plain: The twin without effects, fitted to the first recording.
        other: The other recording.
        elsewhere: `plain` in the other recording.
    """
    hypothesis = other.hypothesis(one.hypothesis)
    if len(hypothesis.effects) < len(one.hypothesis.effects):
        return None
    there = other.followed(one)
    here, again = one.misfit.of(one.hypothesis), there.misfit.freed(hypothesis)
    joint = Joint((here, again))
    found, followed = one.estimate.values, {**one.estimate.values, **there.estimate.values}
    here.divide(here.coordinates.vector(found))
    little = _moderate(one.hypothesis, found)
    own = (plain.estimate.values, elsewhere.estimate.values)
    without = ({**found, **little, **values} for values in own)
    count = len(one.hypothesis.effects)

    def beginning(by: float, *values: Mapping[str, float]) -> Float64[Array, " d"]:
        each = zip((here, again), values, strict=True)
        return joint.vector(*(strong(misfit, known, (by,) * count) for misfit, known in each))

    # after one round there it may be far off still, where the plain twin, after more, is not
    there_too = (followed, {**found, **elsewhere.estimate.values})
    as_found = (beginning(by, found, values) for values in there_too for by in WEAKER)
    starts = [*as_found, beginning(FAINT, *without)]
    low, high = joint.bounds
    tried = np.clip(np.stack(starts), low + 1e-6, high - 1e-6)
    lefts = [joint.left(residuals) for residuals in joint(tried)]
    best = int(np.argmin([np.log(left).sum() for left in lefts]))
    joint = Joint((here, again), lefts[best])
    start = tried[best]
    begun = joint(start[None])[0]
    result = descended(joint, start, begun, joint.belief(begun, start), STEPS, slopes=False)
    each = zip((here, again), joint.of_each(result.x), strict=True)
    first, second = ((misfit, misfit.coordinates.values(vector)) for misfit, vector in each)
    left = joint.left(result.fun[: -len(result.x)])
    return Jointly(first[1], left, (left_slowly(*first), left_slowly(*second)))


def _moderate(hypothesis: Hypothesis, values: Mapping[str, float]) -> dict[str, float]:
    """Amplitudes no larger than fits begin with: of one that ran to its bound hardly any is still much."""
    amplitudes = {f"{e.name}.{name}": e.quantities[name] for e in hypothesis.effects for name in e.absent}
    return {
        name: math.copysign(min(abs(values[name]), abs(quantity.start)), values[name])
        for name, quantity in amplitudes.items()
        if quantity.start
    }
