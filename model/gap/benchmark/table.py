"""The table of scores, each beside what was asked of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from model.gap.benchmark.outcomes import CLEAR, REFUSED, Outcome
from model.gap.benchmark.scores import (
    Score,
    brier,
    calibration_error,
    calibration_error_by_chance,
    closed,
    macro_f1,
    mean,
    proportion,
)
from model.gap.schema import EFFECT_NAMES

MAGNITUDES = (0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Bars:
    """What a score should reach; None: nothing was asked."""

    asked: float | None = None
    """By the issue."""
    good: float | None = None
    """By GAP.md."""
    astonishing: float | None = None
    smaller: bool = False
    """Less is better."""
    most: float | None = None
    """More than this is too much."""


@dataclass(frozen=True)
class Row:
    """A score, what it is of, and its bars."""

    name: str
    of: str
    score: Score
    bars: Bars = field(default_factory=Bars)

    @property
    def holds(self) -> bool | None:
        """Whether the value reaches what was asked; None: nothing was asked, or there is no value."""
        value, bars = self.score.value, self.bars
        if value is None or bars.asked is None:
            return None
        if bars.most is not None:
            return bars.asked <= value <= bars.most
        return value <= bars.asked if bars.smaller else value >= bars.asked


@dataclass(frozen=True)
class Rung:
    """One step of the detectability curve."""

    magnitude: float
    named: Score
    """The verdict is right."""
    noticed: Score
    """The verdict is not `none`."""


@dataclass(frozen=True)
class Table:
    """All scores of a run."""

    rows: tuple[Row, ...]
    ladder: tuple[Rung, ...]
    """Of worlds with an effect of the catalogue, by the nearest of `MAGNITUDES`."""
    kinds: tuple[Row, ...]
    """First answers by what the object is."""


def table(worlds: Sequence[Outcome]) -> Table:
    """Score the outcomes."""
    seen = [each for each in worlds if each.clear]
    known = [each for each in seen if each.names and set(each.names) <= set(EFFECT_NAMES)]
    single = [each for each in known if len(each.names) == 1]
    pairs = [each for each in known if len(each.names) == 2]
    nulls = [each for each in worlds if each.category == "null"]
    errors = [each for each in worlds if not each.names and each.category != "null"]
    outside = [each for each in seen if each.names and "unknown" in each.accepted]
    placed = [each for each in known if not np.isnan(each.area)]
    well = [each for each in placed if each.right]
    moved = [each for each in known if each.transfer is not None]
    above = f"an effect of the catalogue, signal-to-noise ≥ {CLEAR:g}"
    part = "a clear effect that acts on a part"
    rows = (
        Row("top-1", above, _right(known), Bars(0.75, 0.60, 0.85)),
        Row("top-3", above, proportion([_among(each, 3) for each in known]), Bars(0.90, 0.80, 0.97)),
        Row("top-1, one effect", above, _right(single)),
        Row("top-1, two effects: the first is one of them", above, _right(pairs)),
        Row("both of two effects named", above, proportion([each.both for each in pairs])),
        Row("macro-F1", "all answers; no effect or a clear one", _f1(seen)),
        Row("false alarms", "nothing missing", _wrong(nulls), Bars(0.05, 0.05, 0.01, smaller=True)),
        Row("false alarms", "nothing missing, but camera, hand or mesh err", _wrong(errors)),
        Row("recall of unknown", "clear, not of the catalogue", _right(outside), Bars(0.70, 0.60, 0.85)),
        Row("ECE", "no effect or a clear one", _ece(seen), Bars(0.08, 0.10, 0.04, smaller=True)),
        Row("ECE by chance, were probabilities right", "no effect or a clear one", _chance(seen)),
        Row("ECE", "all worlds", _ece(worlds)),
        Row("Brier", "no effect or a clear one", _brier(seen)),
        Row("where: AUC", part, _area(placed), Bars(0.90, 0.80, 0.95)),
        Row("where: AUC", "the same, rightly named", _area(well)),
        Row("where: IoU", part, _overlap(placed), Bars(None, 0.4, 0.7)),
        Row("where: IoU", "the same, rightly named", _overlap(well)),
        Row("gap closed, other interaction", "clear, rightly named", _closed(moved), Bars(0.75, 0.60, 0.90)),
        Row("amplitude intervals cover", "where the truth is known", _cover(worlds), Bars(0.85, most=0.95)),
        Row("refused or broken", "all worlds", proportion([each.answer == REFUSED for each in worlds])),
    )
    return Table(rows, _ladder(worlds), _kinds(known))


def nearest(magnitude: float) -> float:
    """The step of the detectability curve a magnitude belongs to."""
    return min(MAGNITUDES, key=lambda step: abs(np.log(max(magnitude, 1e-9) / step)))


def _ladder(worlds: Sequence[Outcome]) -> tuple[Rung, ...]:
    tested = [each for each in worlds if each.names and set(each.names) <= set(EFFECT_NAMES)]
    rungs = []
    for step in MAGNITUDES:
        there = [each for each in tested if each.magnitude is not None and nearest(each.magnitude) == step]
        noticed = proportion([each.answer not in ("none", REFUSED) for each in there])
        rungs.append(Rung(step, _right(there), noticed))
    return tuple(rungs)


def _kinds(known: Sequence[Outcome]) -> tuple[Row, ...]:
    kinds = sorted({each.kind for each in known})
    return tuple(Row("top-1", kind, _right([each for each in known if each.kind == kind])) for kind in kinds)


def _right(worlds: Sequence[Outcome]) -> Score:
    return proportion([each.right for each in worlds])


def _wrong(worlds: Sequence[Outcome]) -> Score:
    return proportion([each.answer not in (*each.accepted, REFUSED) for each in worlds])


def _among(world: Outcome, first: int) -> bool:
    return bool(set(world.answers[:first]) & set(world.accepted))


def _f1(worlds: Sequence[Outcome]) -> Score:
    return macro_f1([each.truth for each in worlds], [each.answer for each in worlds])


def _scored(score: Callable[[Sequence[float], Sequence[bool]], Score], worlds: Sequence[Outcome]) -> Score:
    answered = [each for each in worlds if each.answer != REFUSED]
    return score([each.confidence for each in answered], [each.right for each in answered])


def _ece(worlds: Sequence[Outcome]) -> Score:
    return _scored(calibration_error, worlds)


def _chance(worlds: Sequence[Outcome]) -> Score:
    return _scored(lambda confidence, _: calibration_error_by_chance(confidence), worlds)


def _brier(worlds: Sequence[Outcome]) -> Score:
    return _scored(brier, worlds)


def _area(worlds: Sequence[Outcome]) -> Score:
    return mean([each.area for each in worlds])


def _overlap(worlds: Sequence[Outcome]) -> Score:
    return mean([each.overlap for each in worlds])


def _closed(worlds: Sequence[Outcome]) -> Score:
    each = [w.transfer for w in worlds if w.transfer is not None]
    pairs = [(c.refit, c.with_effect, c.noise_floor) for c in each]
    fitted = [(refit, after, floor) for refit, after, floor in pairs if after is not None]
    return closed([p[0] for p in fitted], [p[1] for p in fitted], [p[2] for p in fitted])


def _cover(worlds: Sequence[Outcome]) -> Score:
    return proportion([inside for each in worlds for inside in each.covered.values()])
