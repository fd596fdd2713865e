"""All that a screen asks of a recording, as inner products: one simulation of each probe, no residual kept.

Every probe of every effect is rolled out once on top of the fitted twin. How it changes the innovations, how
the twin's own parameters do, how errors of sensors and hands would, and the innovations themselves are
columns; what is kept are their inner products in cells of time and of distance from the grip. Any score
test, of one effect or of several, held out in time or not, is algebra on these.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.bodies.first import first_places
from model.gap.effects.base import Effect
from model.gap.heading import heading
from model.gap.misfit import STEPS, Misfit, Span
from model.gap.probes import probes
from model.gap.side_by_side import side_by_side
from model.gap.stages import Portion
from model.gap.study import Study
from model.types import Array

BLOCKS = 5
"""Cells of time."""
HAND_GAIN = 1.03
"""Hands that move by a little more than is said."""
CALM = 1e-3
"""No cell counts for more than this share of the usual one makes it."""
UNSHARED = ("twin", "sensor", "hand")
"""Kinds of columns that no two recordings share."""


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

    @property
    def weighed(self) -> "Evidence":
        """Each cell counting by how much was seen in it, not by how badly the twin foretells there.

        What a twin does worst, the whipping of an end, the moment of a grasp, says least of what it lacks:
        innovations are weighed by their own size, as a covariance would. To weigh twice changes nothing.
        """
        energy = self.grams[:, -1, -1] / np.maximum(self.counts, 1)
        energy = np.maximum(energy, CALM * max(float(np.median(energy)), 1e-300))
        return replace(self, grams=self.grams / energy[:, None, None])

    def joined(self, other: "Evidence") -> "Evidence":
        """With that of another recording of the same object.

        Effects have the same strength in both; those that can act in the other alone explain nothing here and
        are left out. The twin's own parameters follow in each by themselves, and
        sensors and hands err in each in their own way: those columns are zero in the other's cells.
        """
        places: dict[Hashable, tuple[int | None, int | None]] = {}
        for i, column in enumerate(self.columns):
            places[_key(column, "first", i)] = i, None
        for j, column in enumerate(other.columns):
            key = _key(column, "other", j)
            if key in places or column.kind in UNSHARED:
                places[key] = places.get(key, (None, None))[0], j
        # the innovations stay the last
        places["plain"] = places.pop("plain")
        here, there = zip(*places.values(), strict=True)
        return Evidence(
            tuple(_either(self, i, other, j) for i, j in places.values()),
            np.concatenate([_spread(self.grams, here), _spread(other.grams, there)]),
            np.concatenate([self.counts, other.counts]),
        )

    def of(self, kind: str) -> list[int]:
        """Columns of one kind."""
        return [i for i, column in enumerate(self.columns) if column.kind == kind]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Without repetition, in order."""
        return tuple(dict.fromkeys(column.kind for column in self.columns))


def _key(column: Column, recording: str, index: int) -> Hashable:
    """The same for columns that two recordings share."""
    if column.kind == "plain":
        return "plain"
    own = (recording, index) if column.kind in UNSHARED else ()
    return column.kind, own, tuple(sorted(column.values.items()))


def _either(first: Evidence, i: int | None, other: Evidence, j: int | None) -> Column:
    if i is not None:
        return first.columns[i]
    assert j is not None
    return other.columns[j]


def _spread(grams: Float64[Array, "c p p"], places: Sequence[int | None]) -> Float64[Array, "c q q"]:
    """Inner products of these columns, zero for those that are not there."""
    there = np.array([place is not None for place in places])
    some = np.array([place for place in places if place is not None], np.int64)
    spread = np.zeros((len(grams), len(places), len(places)))
    spread[:, np.outer(there, there)] = grams[:, some[:, None], some].reshape(len(grams), -1)
    return spread


def gather(study: Study, effects: Sequence[Effect], progress: Portion | None = None) -> Evidence:
    """Roll out what could explain the gap that a study found.

    Args:
        study: The fitted twin.
        effects: To try, all able to act.
        progress: Called with the share that is done.
    """
    last = len(study.observation.times) - 1
    span = Span(0, last, study.misfit.span.state)
    misfit = Misfit(study.plain, study.observer, span, study.misfit.noise)
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
    angle = heading(study.plain.twin.body.points)

    def moved(effect: Effect) -> list[tuple[Column, Float64[Array, " m"]]]:
        one = misfit.of(misfit.hypothesis.with_effect(effect).holding(study.base.values))
        # along the body, so that they are the same however it is turned
        tried = [effect.turned(each, angle) for each in probes(effect)]
        named = [{f"{effect.name}.{name}": value for name, value in each.items()} for each in tried]
        rows = one(np.stack([one.coordinates.vector(values) for values in named])) - plain
        return [(Column(effect.name, values), row) for values, row in zip(tried, rows, strict=True)]

    tell = progress or (lambda share: None)
    for found in side_by_side(moved, effects, lambda done: tell(done / len(effects))):
        columns += [column for column, _ in found]
        ways += [row for _, row in found]
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
    seen, there = _seen(misfit), study.observer.seen.numpy()[..., None]
    # from where each was at first, seen then or not: what is measured from the origin would change with it
    moved = np.where(there, points - np.nan_to_num(first_places(study.observation)), 0.0)
    times = study.observation.times
    gain = 1.0 - np.exp(-np.diff(times, prepend=times[0]) / study.observer.patience)
    passed = np.zeros_like(moved)
    kept = np.zeros_like(moved[0])
    for t in range(1, len(times)):
        kept = np.where(there[t], kept + gain[t] * (moved[t] - kept), kept)
        passed[t] = np.where(there[t], moved[t] - kept, 0.0)
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
