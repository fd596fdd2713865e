"""Which effects could explain what a plain twin leaves: a score test, held out in time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.effects.base import Effect
from model.gap.estimate import Estimate, Misfit
from model.types import Array

BLOCKS = 5
"""Into which time is divided: what is fitted on four of them has to explain the fifth."""
RIDGE = 1e-3
"""Of the base directions, relative to their mean size."""


@dataclass(frozen=True)
class Probe:
    """An effect tried at one set of values."""

    values: dict[str, float]
    scale: float
    """By how much it would have to be stronger to explain most."""
    gain: float
    """Share of what the plain twin leaves that it explains where it was fitted."""
    foretold: float
    """Share that it explains in blocks of time that were held out; below zero where it fits noise."""


@dataclass(frozen=True)
class Score:
    """What the score test says of one effect."""

    name: str
    best: Probe
    probes: tuple[Probe, ...]


def screen(
    misfit: Misfit, base: Estimate, effects: Sequence[Effect], blocks: Int64[Array, " m"]
) -> tuple[Score, ...]:
    """Try every effect on top of the fitted plain twin, the twin's own parameters free to follow.

    Args:
        misfit: Of the plain twin.
        base: What its fit found.
        effects: To try, all able to act.
        blocks: Which block of time each residual belongs to.
    """
    plain = misfit(base.vector[None])[0]
    return tuple(_score(misfit, base, effect, plain, blocks) for effect in effects)


def _score(
    misfit: Misfit, base: Estimate, effect: Effect, plain: Float64[Array, " m"], blocks: Int64[Array, " m"]
) -> Score:
    one = misfit.of(misfit.hypothesis.with_effect(effect).holding(base.values))
    tried = probes(effect)
    named = [{f"{effect.name}.{name}": value for name, value in each.items()} for each in tried]
    ways = one(np.stack([one.coordinates.vector(values) for values in named])) - plain
    found = [_explained(base.jacobian, plain, way, blocks) for way in ways]
    results = tuple(Probe(values, *each) for values, each in zip(tried, found, strict=True))
    return Score(effect.name, max(results, key=lambda probe: probe.foretold), results)


def probes(effect: Effect) -> list[dict[str, float]]:
    """Values to try: the start of what makes it present, over a grid of what shapes it."""
    grid = effect.grid
    start = {name: quantity.start for name, quantity in effect.quantities.items()}
    chosen = product(*grid.values())
    return [{**start, **dict(zip(grid, each, strict=True))} for each in chosen]


def _explained(
    jacobian: Float64[Array, "m d"],
    plain: Float64[Array, " m"],
    way: Float64[Array, " m"],
    blocks: Int64[Array, " m"],
) -> tuple[float, float, float]:
    """How strong, what share it explains, and what share of held-out blocks."""
    columns = np.concatenate([jacobian, way[:, None], plain[:, None]], 1)
    grams = np.stack([columns[blocks == b].T @ columns[blocks == b] for b in range(BLOCKS)])
    whole = grams.sum(0)
    count = jacobian.shape[1]
    before, _ = _left(whole, whole, count)
    after, step = _left(whole, whole, count + 1)
    held_before = held_after = 0.0
    for b in range(BLOCKS):
        rest = whole - grams[b]
        held_before += _left(rest, grams[b], count)[0]
        held_after += _left(rest, grams[b], count + 1)[0]
    return step, 1.0 - after / before, 1.0 - held_after / held_before


def _left(fitted: Array, judged: Array, count: int) -> tuple[float, float]:
    """Sum of squares left in `judged` by a fit of the first `count` columns to the last in `fitted`."""
    normal = fitted[:count, :count]
    size = np.trace(normal) / max(count, 1)
    coefficients = -np.linalg.solve(
        normal + RIDGE * np.diag(np.diag(normal) + 1e-9 * size), fitted[:count, -1]
    )
    strength = float(coefficients[-1])
    full = np.concatenate([coefficients, np.zeros(len(fitted) - 1 - count), [1.0]])
    return float(full @ judged @ full), strength
