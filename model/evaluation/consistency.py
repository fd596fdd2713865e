"""Whether the same material gets the same parameters, whatever object it is in and however it is moved."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from model.evaluation.bootstrap import Interval
from model.evaluation.jackknife import spread_interval
from model.evaluation.records import PartRecord, Record

Labelled: TypeAlias = list[tuple[str, float]]
"""Values of one object, each with what it is to be compared within."""


@dataclass(frozen=True)
class Consistency:
    """Spreads of one method; None where nothing is there twice."""

    over_scenes: Interval | None
    """Of ln modulus of the same material, over all parts of all objects. Two objects of one material do not
    have the same modulus, so that the truth itself has such a spread, too."""
    truth_over_scenes: Interval | None
    """The same of the true moduli."""
    error_over_scenes: Interval | None
    """Of estimate - truth of ln modulus of the same material: what is no difference between the objects."""
    over_interactions: Interval | None
    """Of ln modulus of the same part of the same object, over the clips that it was fitted to."""


def consistency(records: Sequence[Record]) -> Consistency:
    """Spreads over the records of one method, with intervals over objects."""

    def spread(
        label: Callable[[Record, PartRecord], str], value: Callable[[PartRecord], float | None]
    ) -> Interval | None:
        groups: dict[str, Labelled] = {}
        for record in records:
            for part in record.parts:
                number = value(part)
                if number is not None:
                    groups.setdefault(record.thing, []).append((label(record, part), number))
        return spread_interval([groups[name] for name in sorted(groups)], _within)

    return Consistency(
        over_scenes=spread(_material, lambda part: part.log_estimate),
        truth_over_scenes=spread(_material, lambda part: part.log_truth),
        error_over_scenes=spread(_material, _error),
        over_interactions=spread(_piece, lambda part: part.log_estimate),
    )


def _material(_: Record, part: PartRecord) -> str:
    return part.material


def _piece(record: Record, part: PartRecord) -> str:
    return f"{record.object_name} {part.part}"


def _error(part: PartRecord) -> float | None:
    return None if part.log_truth is None else part.log_estimate - part.log_truth


def _within(objects: Sequence[Labelled]) -> float:
    """Standard deviation around the mean of each label, pooled; NaN where no label is there twice."""
    values: dict[str, list[float]] = {}
    for labelled in objects:
        for label, value in labelled:
            values.setdefault(label, []).append(value)
    squares = sum(float(((np.array(each) - np.mean(each)) ** 2).sum()) for each in values.values())
    freedom = sum(len(each) - 1 for each in values.values())
    return float(np.sqrt(squares / freedom)) if freedom else float("nan")
