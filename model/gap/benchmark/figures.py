"""Figures of the withheld check: answers mixed up, effects too small, what a probability is worth."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from model.gap.benchmark.outcomes import REFUSED, Outcome
from model.gap.benchmark.scores import BINS, Score, bin_of, confusion
from model.gap.benchmark.table import Table
from model.gap.report.style import BASELINE, EFFECT, FAINT, INK, REFIT, SMALL, new_figure, tidy
from model.gap.report.wording import plain
from model.gap.schema import EFFECT_NAMES

ORDER = (*EFFECT_NAMES, "unknown", "none", REFUSED)
"""Of answers, in tables and figures."""


def classes_of(worlds: Sequence[Outcome]) -> list[str]:
    """Answers that occur, as truth or as verdict, in the order of the catalogue."""
    occurring = {name for each in worlds for name in (each.truth, each.answer)}
    return [name for name in ORDER if name in occurring]


def matrix(worlds: Sequence[Outcome]) -> Figure:
    """Counts of verdicts (columns) by truth (rows), darker where more."""
    classes = classes_of(worlds)
    counts = confusion([each.truth for each in worlds], [each.answer for each in worlds], classes)
    size = len(classes)
    figure = new_figure(1.9 + 0.26 * size, 2.2 + 0.29 * size)
    axes = figure.subplots()
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for row, column in zip(*np.nonzero(counts), strict=True):
        colour = "white" if shares[row, column] > 0.6 else INK
        axes.text(column, row, counts[row, column], ha="center", va="center", fontsize=SMALL, color=colour)
    names = [_plain(name) for name in classes]
    axes.set_xticks(range(size), names, rotation=90, fontsize=SMALL)
    axes.set_yticks(range(size), names, fontsize=SMALL)
    axes.set_xticks(np.arange(size + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(size + 1) - 0.5, minor=True)
    axes.grid(which="minor", color=FAINT, linewidth=0.6)
    axes.tick_params(which="both", length=0)
    axes.set_xlabel("verdict", fontsize=SMALL)
    axes.set_ylabel("truth", fontsize=SMALL)
    return figure


def detectability(table: Table) -> Figure:
    """Shares of worlds whose effect is noticed and named, by its magnitude."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    tidy(axes, grid="y")
    for shift, name, colour, scores in (
        (0.97, "something is missing", BASELINE, [rung.noticed for rung in table.ladder]),
        (1.03, "rightly named", EFFECT, [rung.named for rung in table.ladder]),
    ):
        _points(axes, [rung.magnitude * shift for rung in table.ladder], scores, name, colour)
    axes.set_xscale("log", base=2)
    axes.set_xticks([rung.magnitude for rung in table.ladder])
    axes.set_xticklabels([f"{rung.magnitude:g}\nn = {rung.named.count}" for rung in table.ladder])
    axes.set_ylim(-0.02, 1.02)
    axes.set_xlabel("gap after a refit, over noise and discretisation", fontsize=SMALL)
    axes.set_ylabel("share of worlds", fontsize=SMALL)
    axes.legend(frameon=False, fontsize=SMALL, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure


def calibration(worlds: Sequence[Outcome]) -> Figure:
    """How often a verdict of a probability is right; dots are larger where there are more worlds."""
    figure = new_figure(3.4, 3.6)
    axes = figure.subplots()
    tidy(axes, grid="y")
    axes.plot([0, 1], [0, 1], color=BASELINE, linewidth=1.0, linestyle="--")
    answered = [each for each in worlds if each.answer != REFUSED]
    confidence = np.array([each.confidence for each in answered], float)
    right = np.array([each.right for each in answered], float)
    counts = np.bincount(bin_of(confidence), minlength=BINS)
    used = counts > 0
    said = np.bincount(bin_of(confidence), confidence, BINS)[used] / counts[used]
    true = np.bincount(bin_of(confidence), right, BINS)[used] / counts[used]
    axes.scatter(said, true, s=12 + 180 * counts[used] / max(len(answered), 1), color=REFIT, zorder=3)
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.02, 1.02)
    axes.set_xlabel("probability of the verdict", fontsize=SMALL)
    axes.set_ylabel("share that is right", fontsize=SMALL)
    return figure


def _points(axes: Axes, x: Sequence[float], scores: Sequence[Score], name: str, colour: str) -> None:
    known = [
        (place, score.value, score.value - score.low, score.high - score.value)
        for place, score in zip(x, scores, strict=True)
        if score.value is not None and score.low is not None and score.high is not None
    ]
    places, values, below, above = (list(each) for each in zip(*known, strict=True)) if known else ([],) * 4
    axes.errorbar(
        places, values, yerr=[below, above], fmt="o-", color=colour, label=name, capsize=3, markersize=5
    )


def _plain(name: str) -> str:
    return {REFUSED: "refused"}.get(name) or plain(name)
