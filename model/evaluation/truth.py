"""Parameters against the truth: what stiffness a method means per part, and how right it is."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.stats import norm, rankdata

from model.evaluation.baselines.base import Fitted, PartBelief
from model.evaluation.bootstrap import Interval, interval
from model.evaluation.records import Record
from model.predictor.lattice import lattice_stiffness
from model.predictor.prior_means import volumes
from model.scenes.case import Case
from model.types import Array, MaterialPrior, Parameters

COVERED = 0.9
"""Of the true values, by intervals as wide as the stated spread says."""
WIDTH = float(norm.ppf(0.5 + COVERED / 2.0))
TINY = 1e-6
FEWEST = 3
"""Parts that a rank correlation needs at least."""


@dataclass(frozen=True)
class TruthScores:
    """Part stiffness of one method against the truth; None where nothing is known."""

    rank: Interval | None
    """Spearman's correlation of ln modulus over all parts."""
    error: Interval | None
    """Root mean square of the difference of ln modulus."""
    bias: Interval | None
    """Mean of estimate - truth, of ln modulus."""
    coverage: Interval | None
    """Share of true values within the stated 90 % interval."""
    parts: int


def part_belief(
    fitted: Fitted, shown: Case, priors: Sequence[MaterialPrior] | None = None
) -> PartBelief | None:
    """What a method means by each part's modulus, on the scale of the truth.

    A modulus means a stiffness only together with a volume, and the volume is the mass over the density. The
    density that a method was told may be wrong; its modulus is brought to the density of the case's own
    priors, so that compared are stiffnesses.

    Args:
        fitted: What the method made of the case.
        shown: The case as the method saw it.
        priors: The case's own; None: those that the method saw.

    Returns:
        None where the method has neither a belief nor parameters of the case's topology.
    """
    told = volumes(shown.topology, shown.priors)
    belief = fitted.part_belief
    if belief is None:
        if fitted.parameters is None:
            return None
        belief = PartBelief(_part_log_modulus(fitted.parameters, shown, told))
    if priors is None:
        return belief
    shift = np.log(told) - np.log(volumes(shown.topology, priors))
    return belief._replace(log_modulus=belief.log_modulus + shift)


def _part_log_modulus(
    parameters: Parameters, case: Case, volume: Float64[Array, " K"]
) -> Float64[Array, " K"]:
    """Median of ln k - ln k(1 Pa) over the springs inside each part; over all its springs if none is."""
    unit = lattice_stiffness(case.topology, np.ones(len(volume)), volume, case.shape_class)
    log_modulus = np.log(np.maximum(parameters.stiffness.astype(np.float64), 1e-12)) - np.log(unit)
    ends = case.topology.part[case.topology.springs]
    found = np.full(len(volume), np.nan)
    for part in range(len(volume)):
        inside = (ends == part).all(axis=1)
        chosen = inside if inside.any() else (ends == part).any(axis=1)
        if chosen.any():
            found[part] = float(np.median(log_modulus[chosen]))
    return found


def truth_scores(records: Sequence[Record], seed: int = 0) -> TruthScores:
    """Score the parts of one method's records, with intervals over objects."""
    by_object = _by_object(records)
    tables = [by_object[name] for name in sorted(by_object)]
    return TruthScores(
        rank=interval(tables, _rank, seed),
        error=interval(tables, _error, seed),
        bias=interval(tables, _bias, seed),
        coverage=interval(tables, _coverage, seed),
        parts=sum(len(table) for table in tables),
    )


def global_coverage(records: Sequence[Record], name: str, seed: int = 0) -> Interval | None:
    """Share of the true values of a parameter of the whole object in the stated 90 % interval.

    As it was predicted: of the logarithm, and of the log-odds of a restitution.
    """
    groups: dict[str, list[bool]] = {}
    for record in records:
        entry = record.globals.get(name)
        if entry is not None and entry.std is not None:
            odds = name == "restitution"
            truth, estimate = (_free(value, odds) for value in (entry.truth, entry.estimate))
            slope = entry.estimate * (1.0 - entry.estimate if odds else 1.0)
            spread = entry.std / max(slope, TINY)
            groups.setdefault(record.thing, []).append(abs(estimate - truth) <= WIDTH * spread)
    ordered = [groups[key] for key in sorted(groups)]
    return interval(ordered, lambda chosen: float(np.mean([np.mean(each) for each in chosen])), seed)


def _free(value: float, odds: bool) -> float:
    """The logarithm, or the log-odds."""
    low = max(value, TINY)
    return float(np.log(low) - (np.log(max(1.0 - value, TINY)) if odds else 0.0))


def rank_lost(first: Sequence[Record], second: Sequence[Record], seed: int = 0) -> Interval | None:
    """How far the rank correlation of the second method is below that of the first, on parts told by both."""
    told = _told(first) & _told(second)
    ours, theirs = (_by_object(records, told) for records in (first, second))
    pairs = [(ours[name], theirs[name]) for name in sorted(ours.keys() & theirs.keys())]
    return interval(
        pairs, lambda drawn: _rank([one for one, _ in drawn]) - _rank([other for _, other in drawn]), seed
    )


def _told(records: Sequence[Record]) -> set[tuple[str, int]]:
    """Clips and parts whose truth is known."""
    return {
        (record.case, part.part) for record in records for part in record.parts if part.log_truth is not None
    }


def _by_object(
    records: Sequence[Record], only: Set[tuple[str, int]] | None = None
) -> dict[str, Float64[Array, "n 3"]]:
    """Truth, estimate and stated spread of every part whose truth is known, or of these alone."""
    groups: dict[str, list[tuple[float, float, float]]] = {}
    for record in records:
        for part in record.parts:
            if part.log_truth is not None and (only is None or (record.case, part.part) in only):
                spread = float("nan") if part.log_spread is None else part.log_spread
                groups.setdefault(record.thing, []).append((part.log_truth, part.log_estimate, spread))
    return {name: np.array(rows, np.float64) for name, rows in groups.items()}


def _joined(tables: Sequence[Float64[Array, "n 3"]]) -> tuple[Float64[Array, " m"], ...]:
    truth, estimate, spread = np.concatenate(tables).T
    return truth, estimate, spread


def _rank(tables: Sequence[Float64[Array, "n 3"]]) -> float:
    truth, estimate, _ = _joined(tables)
    if len(truth) < FEWEST:
        return float("nan")
    first, second = rankdata(truth), rankdata(estimate)
    first, second = first - first.mean(), second - second.mean()
    size = float(np.sqrt((first @ first) * (second @ second)))
    # all estimates alike say nothing of the order: that is no correlation, not an unknown one
    return float(first @ second) / size if size > 0.0 else 0.0


def _error(tables: Sequence[Float64[Array, "n 3"]]) -> float:
    truth, estimate, _ = _joined(tables)
    return float(np.sqrt(np.mean((estimate - truth) ** 2)))


def _bias(tables: Sequence[Float64[Array, "n 3"]]) -> float:
    truth, estimate, _ = _joined(tables)
    return float(np.mean(estimate - truth))


def _coverage(tables: Sequence[Float64[Array, "n 3"]]) -> float:
    truth, estimate, spread = _joined(tables)
    stated = np.isfinite(spread)
    if not stated.any():
        return float("nan")
    return float(np.mean(np.abs(estimate - truth)[stated] <= WIDTH * spread[stated]))
