"""All that a screen asks of a recording, as inner products: one simulation of each probe, no residual kept.

Every probe of every effect is rolled out once on top of the fitted twin. How it changes the innovations, how
the twin's own parameters do, how errors of sensors and hands would, and the innovations themselves are
columns; what is kept are their inner products in cells of time and of distance from the grip. Any score
test, of one effect or of several, held out in time or not, is algebra on these.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.bodies.first import first_places
from model.gap.effects.base import Effect
from model.gap.estimate import STEPS, Misfit, Span
from model.gap.probes import probes
from model.gap.study import Study
from model.types import Array

BLOCKS = 5
"""Cells of time."""
HAND_GAIN = 1.03
"""Hands that move by a little more than is said."""


@dataclass(frozen=True)
class Column:
    """What one column of the evidence is of."""

    kind: str
    """`twin`, `sensor`, `hand`, an effect's name, or `plain`: the innovations themselves, the last."""
    values: dict[str, float]
    """Of the effect's quantities."""


@dataclass(frozen=True)
class Evidence:
    """Inner products of columns, in cells of time (outer) and of distance from the grip (inner)."""

    columns: tuple[Column, ...]
    grams: Float64[Array, "c p p"]
    counts: Int64[Array, " c"]
    """Residuals in each cell."""

    def of(self, kind: str) -> list[int]:
        """Columns of one kind."""
        return [i for i, column in enumerate(self.columns) if column.kind == kind]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Without repetition, in order."""
        return tuple(dict.fromkeys(column.kind for column in self.columns))


def gather(
    study: Study, effects: Sequence[Effect], progress: Callable[[float], None] | None = None
) -> Evidence:
    """Roll out what could explain the gap that a study found.

    Args:
        study: The fitted twin.
        effects: To try, all able to act.
        progress: Called with the share that is done.
    """
    last = len(study.observation.times) - 1
    misfit = Misfit(study.plain, study.observer, Span(0, last), study.misfit.noise)
    vector = study.base.vector
    plain = misfit(vector[None])[0]
    columns, ways = [], []
    slopes = misfit.jacobian(vector, STEPS[0])
    columns += [Column("twin", {name: 0.0}) for name in misfit.coordinates.names]
    ways += list(slopes.T)
    for way in _sensor_ways(study, misfit):
        columns.append(Column("sensor", {}))
        ways.append(way)
    if study.plain.twin.observation.controllers.shape[1]:
        columns.append(Column("hand", {}))
        ways.append(_gained(study, misfit)(vector[None])[0] - plain)
    for done, effect in enumerate(effects):
        if progress is not None:
            progress(done / len(effects))
        one = misfit.of(misfit.hypothesis.with_effect(effect).holding(study.base.values))
        tried = probes(effect)
        named = [{f"{effect.name}.{name}": value for name, value in each.items()} for each in tried]
        moved = one(np.stack([one.coordinates.vector(values) for values in named])) - plain
        columns += [Column(effect.name, values) for values in tried]
        ways += list(moved)
    columns.append(Column("plain", {}))
    ways.append(plain)
    cell, count = _cells(study, misfit)
    matrix = np.stack(ways, axis=1)
    grams = np.stack([matrix[cell == c].T @ matrix[cell == c] for c in range(count)])
    return Evidence(tuple(columns), grams, np.bincount(cell, minlength=count))


def _cells(study: Study, misfit: Misfit) -> tuple[Int64[Array, " m"], int]:
    """Which cell each residual is in: five of time, each near the grip and far from it."""
    frames, points = _seen(misfit).nonzero()
    when = frames * BLOCKS // len(study.observation.times)
    places = first_places(study.observation)
    hands = study.observation.controllers[0].astype(np.float64)
    if len(hands):
        away = np.linalg.norm(places[:, None] - hands[None], axis=-1).min(1)
    else:
        away = places[:, 2]
    far = away > np.nanmedian(away)
    return np.repeat(2 * when + far[points], 3), 2 * BLOCKS


def _seen(misfit: Misfit) -> Array:
    seen = misfit.observer.seen.numpy().copy()
    seen[0] = False
    return seen


def _sensor_ways(study: Study, misfit: Misfit) -> list[Float64[Array, " m"]]:
    """What a scale, a shear or a drift of the sensor would do, as far as the observer lets it through."""
    points = study.observer.places.numpy().astype(np.float64)
    seen = _seen(misfit)
    moved = np.where(study.observer.seen.numpy()[..., None], points - points[0], 0.0)
    times = study.observation.times
    gain = 1.0 - np.exp(-np.diff(times, prepend=times[0]) / study.observer.patience)
    passed = np.zeros_like(moved)
    kept = np.zeros_like(moved[0])
    for t in range(1, len(times)):
        kept = kept + gain[t] * (moved[t] - kept)
        passed[t] = moved[t] - kept
    ways = []
    for source in range(3):
        for target in range(3):
            way = np.zeros_like(moved)
            way[..., target] = passed[..., source]
            ways.append(way[seen].reshape(-1) / misfit.noise)
    for target in range(3):
        way = np.zeros_like(moved)
        way[..., target] = study.observer.lost
        ways.append(way[seen].reshape(-1) / misfit.noise)
    return ways


def _gained(study: Study, misfit: Misfit) -> Misfit:
    """The misfit with hands that move by more."""
    twin = study.plain.twin
    moved = twin.controls[0] + HAND_GAIN * (twin.controls - twin.controls[0])
    return misfit.of(replace(study.plain, twin=replace(twin, controls=moved)))
