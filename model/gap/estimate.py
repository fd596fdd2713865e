"""Fit the parameters of a world to what an observer sees: growing horizons, many worlds at once."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from jaxtyping import Float64, Int64
from scipy.optimize import OptimizeResult, least_squares

from model.gap.effects.base import Quantity
from model.gap.hypothesis import Hypothesis
from model.gap.observer import Observer
from model.gap.plain import HAND
from model.gap.world import World
from model.simulator.divergence import SimulationDiverged
from model.simulator.system import State
from model.types import Array

STEPS = (0.08, 0.02)
"""Of a coordinate, for a difference: wider at first, to look across the kinks of contacts, then fine."""
SPARE = 1.3
"""Substeps more than the first world of a fit needs, so that stiffer ones need no more."""
FIRST_HORIZON = 5
"""Frames."""
LOOSE = 3.0
"""Standard deviation of what is believed beforehand, in coordinates."""
TRIALS = 3
"""Places tried for a step, shorter while they lead uphill: each costs far less than the slopes do."""
WIDEST = 16
"""Worlds that are rolled out at once; more would only take memory."""
STEADY: Mapping[str, int] = {HAND: 4, "residual_": 2}
"""How quantities begin whose slopes are kept from step to step, and in how many: then, and where a fit ends,
they are looked at anew. Where a hand is moves what it holds much the same, whatever that is made of, and
there are up to six of them; a flexible force is nearly linear in its forty weights."""


@dataclass(frozen=True)
class Span:
    """The frames that a fit looks at: starts at `first`, in `state`, and ends with `last`."""

    first: int
    last: int
    state: State | None = None


class Coordinates:
    """Quantities as a vector that a fit moves: logarithms over decades, else shares of the bounds."""

    def __init__(self, quantities: Mapping[str, Quantity]) -> None:
        """Of these quantities, in this order."""
        self.quantities = dict(quantities)
        self.names = tuple(quantities)

    def vector(self, values: Mapping[str, float]) -> Float64[Array, " d"]:
        """Coordinates of values, within the bounds."""
        inside = [np.clip(values[name], *self.quantities[name].bounds) for name in self.names]
        each = zip(inside, self.quantities.values(), strict=True)
        return np.array([np.log(x) if q.log else x / self._scale(q) for x, q in each], np.float64)

    def values(self, vector: Float64[Array, " d"]) -> dict[str, float]:
        """What a vector stands for."""
        each = zip(self.names, vector, self.quantities.values(), strict=True)
        return {name: float(np.exp(z) if q.log else z * self._scale(q)) for name, z, q in each}

    def tensors(self, vectors: Float64[Array, "b d"]) -> dict[str, torch.Tensor]:
        """Of shape [b, 1] each."""
        rows = [self.values(vector) for vector in vectors]
        return {name: torch.tensor([[row[name]] for row in rows], dtype=torch.float64) for name in self.names}

    @property
    def bounds(self) -> tuple[Float64[Array, " d"], Float64[Array, " d"]]:
        """Lower and upper."""
        low = self.vector({name: q.bounds[0] for name, q in self.quantities.items()})
        high = self.vector({name: q.bounds[1] for name, q in self.quantities.items()})
        return low, high

    @staticmethod
    def _scale(quantity: Quantity) -> float:
        low, high = quantity.bounds
        return 0.25 * (high - low)


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
        self._kept: dict[str, Float64[Array, " m"]] = {}
        self._stale: tuple[str, ...] = ()

    def __call__(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Innovations over their noise, bounded where a prediction is lost, one row for each world."""
        rows = [self._some(part) for part in _portions(vectors, self.width)]
        return np.concatenate(rows)

    def of(self, hypothesis: Hypothesis) -> "Misfit":
        """The same for another hypothesis."""
        return Misfit(hypothesis, self.observer, self.span, self.noise)

    def until(self, last: int) -> "Misfit":
        """The same over the frames up to `last`."""
        span = replace(self.span, last=last)
        return Misfit(self.hypothesis, self.observer, span, self.noise, self.most)

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

    def settle(self) -> None:
        """Forget how finely time was divided for worlds that were looked at before, and their slopes."""
        self._substeps = self._looks = 0

    def needs(self, vector: Float64[Array, " d"]) -> int:
        """Substeps per frame that the world of a vector asks for."""
        with torch.no_grad():
            return self.observer.substeps(self.hypothesis.at(self.coordinates.values(vector)))

    def divide(self, times: float) -> None:
        """Divide time so many times as finely: a spring that stiffens needs more than it does at rest.

        Only after a call, which finds out what is needed at rest.
        """
        assert self._substeps, "nothing was divided yet"
        self._substeps = max(1, round(times * self._substeps))

    def _divided(self, world: World) -> int | None:
        """Substeps per frame: the same for all worlds of a fit, so that none differs by its time steps.

        None: they would be more than there may be.
        """
        needed = self.observer.substeps(world)
        if self.most is not None and needed > self.most:
            return None
        if needed > self._substeps:
            self._substeps = math.ceil(SPARE * needed)
        return self._substeps

    def jacobian(self, vector: Float64[Array, " d"], width: float = STEPS[-1]) -> Float64[Array, "m d"]:
        """Slopes by one-sided differences of this width, away from the nearer bound.

        Those of `STEADY` quantities may be of one of the places before: see `renewed`.
        """
        names = self.coordinates.names
        kept = {name: one for name, one in self._kept.items() if self._looks % _steadiness(name)}
        self._looks, self._stale = self._looks + 1, tuple(kept)
        moved = [i for i, name in enumerate(names) if name not in kept]
        fresh = zip([names[i] for i in moved], self._slopes(vector, moved, width), strict=True)
        columns = kept | dict(fresh)
        self._kept = {name: one for name, one in columns.items() if _steadiness(name) > 1}
        return np.stack([columns[name] for name in names], axis=1)

    def renewed(self, vector: Float64[Array, " d"], slopes: Float64[Array, "m d"]) -> Float64[Array, "m d"]:
        """What `jacobian` has just given at a vector, with those slopes looked at that it had kept."""
        kept = [i for i, name in enumerate(self.coordinates.names) if name in self._stale]
        if not kept:
            return slopes
        fresh = slopes.copy()
        fresh[:, kept] = np.stack(self._slopes(vector, kept, STEPS[-1]), axis=1)
        return fresh

    def _slopes(
        self, vector: Float64[Array, " d"], moved: Sequence[int], width: float
    ) -> list[Float64[Array, " m"]]:
        """Of the coordinates with these indices."""
        _, high = self.coordinates.bounds
        step = np.where(vector + width > high, -width, width)
        rows = [
            np.concatenate([vector[None], part])
            for part in _portions((vector + np.diag(step))[moved], max(1, self.width - 1))
        ]
        # the unmoved world rolls out beside the moved ones, in the same substeps: else their difference has
        # the time-stepping error in it
        change = [one for found in map(self, rows) for one in found[1:] - found[:1]]
        return [one / step[i] for i, one in zip(moved, change, strict=True)]

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
                led = self.observer.lead(world, span.state, span.first, span.last, substeps=substeps)
        except SimulationDiverged:
            return self._lost(vectors)
        predicted = led.predicted if len(vectors) > 1 else led.predicted.unsqueeze(1)
        error = (predicted - self._places.unsqueeze(1)).movedim(1, 0)[:, self._seen]
        # of the whole vector: no coordinate is the same in a turned world
        far = error.norm(dim=-1, keepdim=True) / self.observer.lost
        bounded = error * (torch.tanh(far) / far.clamp_min(1e-9))
        rows: Float64[Array, "b m"] = bounded.reshape(len(vectors), -1).double().numpy() / self.noise
        return rows

    def _lost(self, vectors: Float64[Array, "b d"]) -> Float64[Array, "b m"]:
        """Of worlds some of which cannot be rolled out: each by itself."""
        if len(vectors) == 1:
            return np.full((1, self.size), self.observer.lost / self.noise)
        return np.concatenate([self._some(vector[None]) for vector in vectors])


@dataclass(frozen=True)
class Estimate:
    """What a fit found."""

    values: dict[str, float]
    vector: Float64[Array, " d"]
    residuals: Float64[Array, " m"]
    """Innovations over their noise."""
    jacobian: Float64[Array, "m d"]
    evaluations: int

    @property
    def cost(self) -> float:
        """Mean square of the residuals: 1 where only noise is left."""
        return float(np.mean(self.residuals**2))


def estimate(
    misfit: Misfit,
    starts: Float64[Array, "s d"],
    steps: int,
    shortest: int = FIRST_HORIZON,
    *,
    slopes: bool = True,
) -> Estimate:
    """The best of several starts, followed to its minimum over a growing horizon.

    Soft bodies that swing are nearly chaotic: over a long horizon the misfit is rough and its valleys narrow.
    Over a few frames it is smooth, and each longer horizon starts where the last one ended.

    Args:
        misfit: What is to be small.
        starts: Where to begin; all are looked at, the best is followed.
        steps: Gauss-Newton steps at most for each horizon; each costs one rollout per coordinate, and one.
            The first only looks at the slopes where the horizon starts.
        shortest: Frames of the first horizon; who starts near the minimum needs no short ones.
        slopes: Where it ends slopes are looked at as well. Without, they are those of the step before.
    """
    spent = 0
    vector = found = jacobian = None
    for last in _horizons(misfit.span, shortest):
        part = misfit.until(last)
        low, high = part.coordinates.bounds
        if vector is None:
            inside = np.clip(starts, low + 1e-6, high - 1e-6)
            vector = inside[int((part(inside) ** 2).mean(1).argmin())] if len(inside) > 1 else inside[0]
            part.settle()
        ends = last == misfit.span.last
        found = descended(part, vector, starts[0], steps, slopes=slopes and ends)
        vector = np.clip(found.x, low + 1e-6, high - 1e-6)
        jacobian = found.jac[: len(found.fun) - len(vector)]
        if slopes and ends:
            jacobian = part.renewed(found.x, jacobian)
        spent += part.evaluations
    assert found is not None
    assert jacobian is not None
    return Estimate(
        misfit.coordinates.values(found.x),
        found.x,
        found.fun[: len(jacobian)],
        jacobian,
        spent,
    )


def _horizons(span: Span, frames: int) -> list[int]:
    """Last frames, each twice as far as the one before."""
    whole = span.last - span.first
    horizons = []
    while frames < 0.75 * whole:
        horizons.append(span.first + frames)
        frames *= 2
    return [*horizons, span.last]


def descended(
    misfit: Residuals,
    vector: Float64[Array, " d"],
    believed: Float64[Array, " d"],
    steps: int,
    *,
    slopes: bool = True,
) -> OptimizeResult:
    """Gauss-Newton with wide differences, then with fine ones.

    What the frames so far say nothing of stays near what is believed.

    Args:
        misfit: What is to be small.
        vector: Where to begin, within the bounds.
        believed: Coordinates that are believed beforehand, `LOOSE` far.
        steps: At most; the first only looks at the slopes.
        slopes: Are looked at where it ends as well, which costs as much as a step. Without, what is returned
            has those of the step before.

    Returns:
        Of `scipy.optimize.least_squares`; the last residuals, one a coordinate, are of what is believed.
    """

    def residuals(at: Float64[Array, " d"]) -> Float64[Array, " r"]:
        return np.concatenate([misfit(at[None])[0], (at - believed) / LOOSE])

    seen: list[Float64[Array, "r d"]] = []

    def jacobian(at: Float64[Array, " d"], width: float) -> Float64[Array, "r d"]:
        if slopes or len(seen) < max(1, steps - 1):
            seen.append(np.concatenate([misfit.jacobian(at, width), np.eye(len(at)) / LOOSE]))
        return seen[-1]

    low, high = misfit.bounds
    left, found = steps, None
    for width in STEPS:
        found = least_squares(
            residuals,
            vector,
            partial(jacobian, width=width),
            bounds=(low, high),
            max_nfev=1 + TRIALS * (left - 1),
            xtol=0.05 * width,
            ftol=1e-3,
            callback=_after(left - 1),
        )
        vector, left = np.clip(found.x, low + 1e-6, high - 1e-6), left - found.njev
        if left <= 0:
            break
    return found


def _after(steps: int) -> Callable[[OptimizeResult], None]:
    """Ends a fit that has taken so many steps, however many were tried in vain."""
    taken = 0

    def ended(intermediate_result: OptimizeResult) -> None:
        nonlocal taken
        taken += 1
        if taken >= steps:
            raise StopIteration

    return ended


def _steadiness(name: str) -> int:
    """Steps in which slopes of a quantity are as they were looked at."""
    return max((steps for begins, steps in STEADY.items() if name.startswith(begins)), default=1)


def _portions(vectors: Float64[Array, "b d"], size: int) -> list[Float64[Array, "c d"]]:
    return [vectors[i : i + size] for i in range(0, len(vectors), size)]
