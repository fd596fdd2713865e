"""What a fit makes small: how far worlds are from what an observer sees, many at once, and its slopes."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64

from model.gap.belief import LOOSE, Belief, residual_unit
from model.gap.coordinates import Coordinates
from model.gap.erring_hand import HAND, HOLD
from model.gap.hypothesis import Hypothesis
from model.gap.observer import Observer
from model.gap.world import World
from model.simulator.pace import TooManySubsteps
from model.simulator.system import State
from model.types import Array

STEPS = (0.08, 0.02)
"""Of a coordinate, for a difference: wider at first, to look across the kinks of contacts, then fine."""
SPARE = 1.3
"""Substeps more than the first world of a fit needs, so that stiffer ones need no more."""
FINER, NEEDED = (2, 4, 8), 0.7
"""Times as fine as stability asks for; time is divided so while that leaves less than this share."""
WIDEST = 32
"""Worlds that are rolled out at once, two vectors of a wide processor full: more would only take memory."""
STEADY: Mapping[str, int] = {HAND: 4, HOLD: 2, "residual_": 2}
"""How quantities begin whose slopes are kept from step to step, and in how many: then, and where a fit ends,
they are looked at anew. Where a hand is, and where it holds the body, moves that much the same, whatever
it is made of, and there are up to twelve of them; a flexible force is nearly linear in its forty weights."""


@dataclass(frozen=True)
class Span:
    """The frames that a fit looks at: starts at `first`, in `state`, and ends with `last`."""

    first: int
    last: int
    state: State | None = None


class Residuals(ABC):
    """What a fit makes small, as a function of a vector of coordinates."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Float64[Array, " d"], Float64[Array, " d"]]:
        """Lower and upper, of each coordinate."""

    @abstractmethod
    def __call__(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """One row for each vector."""

    @abstractmethod
    def jacobian(self, vector: Float64[Array, " d"], width: float) -> Float64[Array, "m d"]:
        """Slopes at a vector by differences of this width."""

    @abstractmethod
    def belief(self, residuals: Float64[Array, " m"], around: Float64[Array, " d"]) -> Belief:
        """What is believed of coordinates beside the residuals, as much as it counts while these are left.

        Args:
            residuals: Where a fit begins.
            around: Near which it stays in what nothing is known of.
        """


class Misfit(Residuals):
    """Weighted innovations of the worlds that vectors of coordinates stand for.

    Args:
        hypothesis: Makes a world of values.
        observer: What follows the observation.
        span: Which frames count.
        noise: Standard deviation of an innovation that is noise alone [m].
        most: Substeps per frame; a world that needs more is given up as lost. None: none is.
    """

    def __init__(
        self,
        hypothesis: Hypothesis,
        observer: Observer,
        span: Span,
        noise: float,
        most: int | None = None,
    ) -> None:
        """See the class."""
        self.hypothesis, self.observer, self.span, self.noise = hypothesis, observer, span, noise
        self.most = most
        self.coordinates = Coordinates(hypothesis.quantities)
        self.width = WIDEST if hypothesis.together else 1
        self.evaluations, self._substeps, self._looks = 0, 0, 0
        frames = slice(span.first, span.last + 1)
        self._seen = observer.seen[frames].clone()
        self._seen[0] = False
        self._places = observer.places[frames]
        self._slopes: Float64[Array, "m d"] = np.empty((0, 0))

    def __call__(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Innovations over their noise, bounded where a prediction is lost, one row for each world."""
        rows = [self._some(part) for part in _portions(vectors, self.width)]
        return np.concatenate(rows)

    def of(self, hypothesis: Hypothesis) -> "Misfit":
        """The same for another hypothesis."""
        return Misfit(hypothesis, self.observer, self.span, self.noise)

    def freed(self, hypothesis: Hypothesis) -> "Misfit":
        """The same for another hypothesis of the same world, time divided as finely."""
        other = self.of(hypothesis)
        other._substeps = self._substeps
        return other

    def until(self, last: int) -> "Misfit":
        """The same over the frames up to `last`, time divided as finely."""
        return self.through(self.observer, replace(self.span, last=last))

    def giving_up(self, most: int) -> "Misfit":
        """The same, in which a world that needs more than so many substeps per frame is lost."""
        return Misfit(self.hypothesis, self.observer, self.span, self.noise, most)

    def through(self, observer: Observer, span: Span) -> "Misfit":
        """The same of other frames, as another observer of them sees it, time divided as finely."""
        other = Misfit(self.hypothesis, observer, span, self.noise, self.most)
        other._substeps = self._substeps
        return other

    @property
    def bounds(self) -> tuple[Float64[Array, " d"], Float64[Array, " d"]]:
        """Lower and upper, of each coordinate."""
        return self.coordinates.bounds

    @property
    def size(self) -> int:
        """How many innovations there are: three for each point that is seen in a frame."""
        return 3 * int(self._seen.sum())

    def frame_of_residuals(self) -> Int64[Array, " m"]:
        """Of each innovation, counted from the first of the span."""
        return np.repeat(self._seen.nonzero()[:, 0].numpy(), 3)

    def field(self, residuals: Float64[Array, " m"]) -> Float64[Array, "F N 3"]:
        """Of each frame of the span and each point; zero where nothing was seen."""
        field = np.zeros((*self._seen.shape, 3))
        field[self._seen.numpy()] = residuals.reshape(-1, 3)
        return field

    def belief(self, residuals: Float64[Array, " m"], around: Float64[Array, " d"]) -> Belief:
        """Of the quantities that say so, around their usual start; of all others next to nothing."""
        spread = self.coordinates.spreads
        known = np.isfinite(spread)
        if not known.any():
            return Belief.loose(around)
        unit = residual_unit(self.field(residuals), self._seen.numpy())
        centre = np.where(known, self.coordinates.starts, around)
        return Belief(centre, np.where(known, spread, LOOSE), np.where(known, unit, 1.0))

    def settle(self) -> None:
        """Forget how finely time was divided for worlds that were looked at before, and their slopes."""
        self._substeps = self._looks = 0

    def needs(self, vector: Float64[Array, " d"]) -> int:
        """Substeps per frame that the world of a vector asks for."""
        with torch.no_grad():
            world = self.hypothesis.at(self.coordinates.values(vector))
            return self.observer.substeps(world, self.span.state)

    def within(self, vectors: Float64[Array, "b d"], most: float) -> Int64[Array, " c"]:
        """Which of these worlds ask for no more substeps per frame, or else for the fewest."""
        if self.hypothesis.together:
            # all at once are asked as quickly as one, and say within a tenth what the most demanding needs
            with torch.no_grad():
                worlds = self.hypothesis(self.coordinates.tensors(vectors))
                if SPARE * self.observer.substeps(worlds, self.span.state) <= most:
                    return np.arange(len(vectors))
        needed = np.array([self.needs(vector) for vector in vectors])
        return np.flatnonzero(needed <= max(most, needed.min()))

    def divide(self, vector: Float64[Array, " d"]) -> None:
        """Divide time as finely as a world needs: a spring that stiffens needs more than at rest.

        From where it is lost to its time steps no fit finds back.
        """
        residuals = self(vector[None])[0]
        coarse, kept, least = self._substeps, 1, float((residuals**2).mean())
        for finer in FINER:
            self._substeps = finer * coarse
            residuals = self(vector[None])[0]
            left = float((residuals**2).mean())
            if left < NEEDED * least:
                kept, least = finer, left
            elif not self._is_lost(residuals):
                break
        self._substeps = kept * coarse

    def _is_lost(self, residuals: Float64[Array, " m"]) -> bool:
        """Of a world that diverged."""
        return bool((residuals == self.observer.lost / self.noise).all())

    def _divided(self, world: World) -> int | None:
        """Substeps per frame: the same for all worlds of a fit, so that none differs by its time steps.

        None: they would be more than there may be.
        """
        needed = self.observer.substeps(world, self.span.state)
        if self.most is not None and needed > self.most:
            return None
        if needed > self._substeps:
            self._substeps = math.ceil(SPARE * needed)
        return self._substeps

    def jacobian(self, vector: Float64[Array, " d"], width: float = STEPS[-1]) -> Float64[Array, "m d"]:
        """Slopes by one-sided differences of this width, away from the nearer bound.

        Those of `STEADY` quantities may be of one of the places before: see `renewed`.
        """
        fresh = self._looked_at(self._looks)
        slopes = self._slopes.copy() if self._looks else np.empty((self.size, len(vector)))
        slopes[:, fresh] = self._differences(vector, fresh, width)
        self._looks, self._slopes = self._looks + 1, slopes
        return slopes

    def renewed(self, vector: Float64[Array, " d"], slopes: Float64[Array, "m d"]) -> Float64[Array, "m d"]:
        """What `jacobian` has just given at a vector, with those slopes looked at that it had kept."""
        kept = ~self._looked_at(self._looks - 1)
        if not kept.any():
            return slopes
        fresh = slopes.copy()
        fresh[:, kept] = self._differences(vector, kept, STEPS[-1])
        return fresh

    def _looked_at(self, look: int) -> Bool[Array, " d"]:
        """Of which coordinates slopes are looked at, the first and every so many times."""
        return np.array([look % _steadiness(name) == 0 for name in self.coordinates.names])

    def _differences(
        self, vector: Float64[Array, " d"], moved: Bool[Array, " d"], width: float
    ) -> Float64[Array, "m k"]:
        """Slopes of some of the coordinates."""
        _, high = self.coordinates.bounds
        step = np.where(vector + width > high, -width, width)
        rows = [
            np.concatenate([vector[None], part])
            for part in _portions((vector + np.diag(step))[moved], max(1, self.width - 1))
        ]
        # the unmoved world rolls out beside the moved ones, in the same substeps: else their difference has
        # the time-stepping error in it
        change = np.concatenate([found[1:] - found[:1] for found in map(self, rows)])
        slopes: Float64[Array, "m k"] = (change / step[moved, None]).T
        return slopes

    def _some(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        self.evaluations += len(vectors)
        try:
            with torch.no_grad():
                values = self.coordinates.tensors(vectors)
                if len(vectors) == 1:
                    values = {name: value[0, 0] for name, value in values.items()}
                world, span = self.hypothesis(values), self.span
                substeps = self._divided(world)
                if substeps is None:
                    return self._lost(vectors)
                led = self.observer.lead(
                    world, span.state, span.first, span.last, substeps=substeps, lossy=True
                )
        except TooManySubsteps:
            return self._lost(vectors)
        predicted = led.predicted if len(vectors) > 1 else led.predicted.unsqueeze(1)
        error = (predicted - self._places.unsqueeze(1)).movedim(1, 0)[:, self._seen]
        bounded = self.observer.bounded(error)
        rows: Float64[Array, "b m"] = bounded.reshape(len(vectors), -1).double().numpy() / self.noise
        rows[led.lost.reshape(len(vectors)).numpy()] = self.observer.lost / self.noise
        return rows

    def _lost(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Of worlds some of which need more substeps than there may be: each by itself."""
        if len(vectors) == 1:
            return np.full((1, self.size), self.observer.lost / self.noise)
        return np.concatenate([self._some(vector[None]) for vector in vectors])


def _steadiness(name: str) -> int:
    """Steps in which slopes of a quantity are as they were looked at."""
    return max((steps for begins, steps in STEADY.items() if name.startswith(begins)), default=1)


def _portions(vectors: Float64[Array, "b d"], size: int) -> list[Float64[Array, "c d"]]:
    return [vectors[i : i + size] for i in range(0, len(vectors), size)]
