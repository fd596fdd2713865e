"""What a diagnosis compares everything with: a plain twin, fitted to part of what was seen."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.stats import qmc

from model.gap.erring_hand import HAND, HOLD
from model.gap.estimate import FIRST_HORIZON, Estimate, estimate
from model.gap.guessed_twin import guessed_twin
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit, Span
from model.gap.noise import noise_of
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.side_by_side import side_by_side
from model.types import Array, Observation

PATIENCE = 0.15
"""Of the observer [s]: long enough to see forces through the noise, short enough to forget."""
HELD_OUT = 0.3
"""Share of the time, at its end, that no fit sees."""
LEAST_NOISE = 3e-4
"""Innovations are weighed by no less [m]: twins are not exact to the last digit of a good sensor."""
STEPS = 4
"""Gauss-Newton steps for each horizon; every fit of a diagnosis gets as many."""
STARTS = 35
"""Places that a fit looks at."""
FOLLOWED = {"rope": 5, "sheet": 2, "solid": 2}
"""Of them, those that it begins from. Fits of ropes end a fifth apart, others are seldom worth their time."""
SPREAD = {
    "stiffness": 4.0,
    "damping": 2.5,
    "drag_rate": 2.0,
    "grip": 2.0,
    "reach": 1.8,
    "friction": 1.2,
    "bending": 1.5,
    "bending_decay": 1.5,
}
"""How far around the places are, in powers of e."""
DEAR = 1.5e7
"""Work from which on less is looked at: stiff solids take longer than anything else."""
COSTLIEST = 2.0
"""There no fit leads to where so many times finer time steps are needed than by the plain twin."""


@dataclass(frozen=True)
class Study:
    """A plain twin fitted to the first part of an observation; the rest is held out."""

    observation: Observation
    plain: Hypothesis
    """The twin without effects."""
    observer: Observer
    misfit: Misfit
    """Of the plain twin over the frames that fits see."""
    start: dict[str, float]
    """Parameters that the twin came with."""
    base: Estimate
    """Parameters that fit best."""
    noise: float
    """Standard deviation of the measured places [m]."""
    split: int
    """First frame that no fit sees."""

    @property
    def seen(self) -> Bool[Array, "F N"]:
        """Which points each of the misfit's residuals is of, over its frames; the first has none."""
        seen: Bool[Array, "F N"] = self.observer.seen[: self.split].numpy().copy()
        seen[0] = False
        return seen

    @cached_property
    def substeps(self) -> int:
        """Per frame, that the plain twin asks for."""
        return self.misfit.needs(self.base.vector)

    @property
    def work(self) -> int:
        """Of a rollout: springs times substeps of the plain twin, over all frames."""
        return len(self.plain.twin.body.springs) * len(self.observation.times) * self.substeps

    @property
    def dear(self) -> bool:
        """A rollout takes so long that whoever has a choice looks at less."""
        return self.work > DEAR

    def in_time(self, misfit: Misfit) -> Misfit:
        """The same; where rollouts take long, worlds that take much longer still are given up as lost."""
        if not self.dear:
            return misfit
        return misfit.giving_up(round(COSTLIEST * self.substeps))

    def frame_of_residuals(self) -> Int64[Array, " m"]:
        """Frame of each residual of the misfit, which has three for each point that is seen."""
        return self.misfit.frame_of_residuals()

    def residuals(self, estimate: Estimate) -> Float64[Array, "F N 3"]:
        """Innovations over their noise as an array; zero where nothing was seen."""
        return self.misfit.field(estimate.residuals)


def study(observation: Observation, twin: PlainTwin | None = None) -> Study:
    """Fit a plain twin to the first part of an observation.

    Args:
        observation: What really moved.
        twin: What it is compared with; None: made from the observation's first frame.
    """
    twin = twin or guessed_twin(observation)
    noise = noise_of(observation)
    misfit, start = misfit_of(twin, observation, noise)
    base, split = best_fit(misfit, start), misfit.span.last + 1
    return Study(observation, misfit.hypothesis, misfit.observer, misfit, start, base, noise, split)


def misfit_of(twin: PlainTwin, observation: Observation, noise: float) -> tuple[Misfit, dict[str, float]]:
    """Of a plain twin over the frames that fits see, and the parameters that the twin came with.

    Args:
        twin: Before any fit.
        observation: What really moved.
        noise: Standard deviation of the measured places [m].
    """
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    observer = Observer(observation, plain.at(start), PATIENCE)
    last = max(3, round((1.0 - HELD_OUT) * len(observation.times))) - 1
    return Misfit(plain, observer, Span(0, last), max(noise, LEAST_NOISE)), start


def best_fit(misfit: Misfit, start: dict[str, float]) -> Estimate:
    """From where a twin came, and from the better of many places all around: the fit that leaves least.

    Over short horizons all parameters predict alike, over long ones the misfit is rough: whoever follows one
    start alone ends in some valley. So many are looked at over the whole time, and the best of them are
    followed from a quarter of it on.
    """
    tried = starts_of(misfit, start)
    left = (misfit(tried) ** 2).mean(1)
    misfit.settle()
    shape = misfit.hypothesis.twin.body.shape
    quarter = quarter_of(misfit)
    followed = [tried[i] for i in np.argsort(left, kind="stable")[: FOLLOWED[shape]]]
    found = side_by_side(lambda one: estimate(misfit, one[None], STEPS, quarter), followed)
    return min(found, key=lambda one: one.cost)


def quarter_of(misfit: Misfit) -> int:
    """Frames of the first horizon of a fit that begins at what looks best over the whole time."""
    return max(FIRST_HORIZON, (misfit.span.last - misfit.span.first) // 4)


def starts_of(misfit: Misfit, start: dict[str, float]) -> Float64[Array, "s d"]:
    """Where a fit of the plain twin may begin: what it came with first, then places spread evenly around."""
    coordinates = misfit.coordinates
    first = coordinates.vector(start)
    spread = qmc.Halton(len(first), scramble=False).random(STARTS + 1)[1:]
    low, high = coordinates.bounds
    reach = np.array([SPREAD.get(name, 1.0) if q.log else 0.0 for name, q in coordinates.quantities.items()])
    begin = np.where(reach > 0, np.maximum(first - reach, low), low)
    end = np.where(reach > 0, np.minimum(first + reach, high), high)
    # stiffness that grows along the body, and hands that are elsewhere, are for the fit to find
    even = np.array([name.startswith(("gradient", HAND, HOLD)) for name in coordinates.names])
    around = np.where(even, first, begin + spread * (end - begin))
    return np.concatenate([first[None], around])
