"""Search without gradients, over a box."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import cma
import numpy as np
from jaxtyping import Float64

from model.types import Array

FIRST_STEP = 1.0 / 6.0
"""Standard deviation of the first generation, over the width of the box."""
WORST = 1e9
"""In the place of a loss that is not finite."""


@dataclass(frozen=True)
class Axis:
    """One searched number, on the scale on which it is searched."""

    name: str
    start: float
    low: float
    high: float

    def at(self, share: float) -> float:
        """The number at a share of the way from low to high."""
        return self.low + float(np.clip(share, 0.0, 1.0)) * (self.high - self.low)

    @property
    def share(self) -> float:
        """Where the start is."""
        return float(np.clip((self.start - self.low) / (self.high - self.low), 0.0, 1.0))


def evolve(
    axes: Sequence[Axis],
    loss: Callable[[Mapping[str, float]], float],
    *,
    generations: int,
    population: int | None,
    seed: int,
) -> tuple[dict[str, float], float]:
    """The best numbers that CMA-ES comes by, the start included, and their loss.

    Args:
        axes: What is searched.
        loss: To be minimised; not finite: as bad as can be.
        generations: At most.
        population: Evaluations per generation; None: 4 + 3 ln n, the usual number for n axes.
        seed: Of its random numbers, which are its own.

    Reference:
        Hansen and Ostermeier (2001), Completely derandomized self-adaptation in evolution strategies,
        Evolutionary Computation 9 (as the package `cma` has it).
    """

    def named(place: Float64[Array, " n"]) -> dict[str, float]:
        return {axis.name: axis.at(share) for axis, share in zip(axes, place, strict=True)}

    def judged(place: Float64[Array, " n"]) -> float:
        value = loss(named(place))
        return value if np.isfinite(value) else WORST

    random = np.random.default_rng(seed)
    begin = np.array([axis.share for axis in axes], np.float64)
    best, least = begin, judged(begin)
    options = {"bounds": [0.0, 1.0], "verbose": -9, "seed": np.nan, "randn": _normal(random)}
    if population is not None:
        options["popsize"] = population
    strategy = cma.CMAEvolutionStrategy(begin, FIRST_STEP, options)
    for _ in range(generations):
        if strategy.stop():
            break
        places = strategy.ask()
        losses = [judged(place) for place in places]
        strategy.tell(places, losses)
        if min(losses) < least:
            best, least = places[int(np.argmin(losses))], min(losses)
    return named(best), least


def _normal(random: np.random.Generator) -> Callable[..., Float64[Array, "*shape"]]:
    """Normal numbers in the manner of `numpy.random.randn`, but not from numpy's global state."""

    def draw(*shape: int) -> Float64[Array, "*shape"]:
        return np.asarray(random.standard_normal(shape), np.float64)

    return draw
