"""What a diagnosis compares everything with: a plain twin, fitted to part of what was seen."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from model.gap.bodies.body import body_of
from model.gap.estimate import Estimate, Misfit, Span, estimate
from model.gap.hypothesis import Hypothesis
from model.gap.observer import Observer, noise_of
from model.gap.plain import PlainTwin
from model.types import Array, Observation

PATIENCE = 0.15
"""Of the observer [s]: long enough to see forces through the noise, short enough to forget."""
HELD_OUT = 0.3
"""Share of the time, at its end, that no fit sees."""
LEAST_NOISE = 3e-4
"""Innovations are weighed by no less [m]: twins are not exact to the last digit of a good sensor."""
STEPS = 4
"""Gauss-Newton steps for each horizon; every fit of a diagnosis gets as many."""
SPREAD = (-4.0, -2.0, 0.0, 2.0, 4.0)
"""Starts of a fit: the stiffness, by so many powers of e."""


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

    def frame_of_residuals(self) -> Int64[Array, " m"]:
        """Frame of each residual of the misfit, which has three for each point that is seen."""
        return np.repeat(np.nonzero(self.seen)[0], 3)

    def residuals(self, estimate: Estimate) -> Float64[Array, "F N 3"]:
        """Innovations over their noise as an array; zero where nothing was seen."""
        field = np.zeros((*self.seen.shape, 3))
        field[self.seen] = estimate.residuals.reshape(-1, 3)
        return field


def study(observation: Observation, twin: PlainTwin | None = None) -> Study:
    """Fit a plain twin to the first part of an observation.

    Args:
        observation: What really moved.
        twin: What it is compared with; None: made from the observation's first frame.
    """
    twin = twin or PlainTwin.of(body_of(observation), observation)
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    observer = Observer(observation, plain.at(start), PATIENCE)
    noise = noise_of(observation)
    split = max(3, round((1.0 - HELD_OUT) * len(observation.times)))
    misfit = Misfit(plain, observer, Span(0, split - 1), max(noise, LEAST_NOISE))
    base = estimate(misfit, starts_of(misfit, start), STEPS)
    return Study(observation, plain, observer, misfit, start, base, noise, split)


def starts_of(misfit: Misfit, start: dict[str, float]) -> Float64[Array, "s d"]:
    """Where a fit of the plain twin may begin: what it came with first, then softer and stiffer."""
    first = misfit.coordinates.vector(start)
    stiffness = np.array([name == "stiffness" for name in misfit.coordinates.names], np.float64)
    others = [first + by * stiffness for by in SPREAD if by]
    return np.stack([first, *others])
