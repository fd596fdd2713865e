"""Figures of an evaluation: errors with intervals and over time, stiffness against the truth, calibration."""

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from model.evaluation.bootstrap import mean_interval
from model.evaluation.protocol import Setting
from model.evaluation.records import Record
from model.evaluation.tables import TITLES, by_object, values
from model.gap.report.style import (
    BASELINE,
    CEILING,
    EFFECT,
    FLOOR,
    MUTED,
    OBSERVED,
    REFIT,
    SMALL,
    WIDTH,
    new_figure,
    tidy,
)
from model.types import Array

PALETTE = (
    EFFECT,
    REFIT,
    CEILING,
    FLOOR,
    "#CC79A7",
    "#E69F00",
    "#F0E442",
    OBSERVED,
    BASELINE,
    "#332288",
    "#882255",
    "#999933",
)
"""Of methods in their order; the first stands out."""
NAMES = 2.0
"""Room for the names of methods beside a panel [inch]."""
PANELS = 4
"""Methods whose stiffness is drawn, at most, in a row."""
TITLE = 18
"""Characters in a line of a panel's title: longer ones reached into the next panel."""
STATED = np.linspace(0.05, 0.95, 19)
"""Probabilities of the intervals whose coverage is drawn."""

Records = Mapping[str, Sequence[Record]]


def figures(of: Records, settings: Sequence[Setting]) -> dict[str, tuple[str, Figure]]:
    """All figures that these records give, with their captions, by file name.

    Args:
        of: Records by method, the first is the one that is compared.
        settings: Which of them are shown.
    """
    made = {"errors.png": ("Track error by setting, with 95 % intervals over objects", errors(of, settings))}
    if any(len(record.curve) > 1 for records in of.values() for record in records):
        made["time.png"] = ("Track error over the clip; learned from left of the line", over_time(of))
    known = {name: records for name, records in of.items() if len(_parts(records))}
    if known:
        made["stiffness.png"] = ("Modulus of the parts, estimated against true", stiffness(known))
    stated = {name: records for name, records in known.items() if np.isfinite(_parts(records)[:, 2]).any()}
    if stated:
        made["calibration.png"] = (
            "Share of true moduli in intervals of a stated probability",
            calibration(stated),
        )
    return made


def errors(of: Records, settings: Sequence[Setting]) -> Figure:
    """Mean track error of every method in every setting."""
    figure = new_figure(1.1 + 0.32 * len(of), 2.2 * max(len(settings), 2))
    panels = np.atleast_1d(figure.subplots(1, len(settings), sharey=True))
    for axes, setting in zip(panels, settings, strict=True):
        tidy(axes, grid="x")
        for row, (name, records) in enumerate(of.items()):
            found = mean_interval(by_object(values(records, setting, "track")))
            if found is not None:
                figure_mm = found.scaled(1e3)
                wide = None
                if figure_mm.low is not None and figure_mm.high is not None:
                    wide = [[figure_mm.value - figure_mm.low], [figure_mm.high - figure_mm.value]]
                axes.errorbar(figure_mm.value, row, xerr=wide, fmt="o", color=_colour(of, name), capsize=3)
        axes.set_title(fill(TITLES[setting], TITLE), fontsize=SMALL)
        axes.set_xlabel("track error [mm]", fontsize=SMALL)
        axes.set_xlim(left=0.0)
        axes.set_yticks(range(len(of)), list(of), fontsize=SMALL)
        axes.set_ylim(len(of) - 0.5, -0.5)
    return figure


def over_time(of: Records) -> Figure:
    """Mean track error over the share of the clip that has passed."""
    figure = new_figure(3.4, WIDTH + NAMES)
    axes = figure.subplots()
    tidy(axes, grid="y")
    share = np.linspace(0.0, 1.0, 60)
    for name, records in of.items():
        curves = [
            np.interp(share, np.linspace(0.0, 1.0, len(record.curve)), record.curve)
            for record in records
            if len(record.curve) > 1
        ]
        if curves:
            axes.plot(share, 1e3 * np.mean(curves, axis=0), color=_colour(of, name), label=name)
    axes.axvline(0.7, color=MUTED, linewidth=0.8, linestyle="--")
    axes.set_xlabel("share of the clip", fontsize=SMALL)
    axes.set_ylabel("track error [mm]", fontsize=SMALL)
    axes.set_ylim(bottom=0.0)
    _name_lines(figure)
    return figure


def stiffness(of: Records) -> Figure:
    """Estimated over true modulus of every part, per method."""
    shown = list(of)[:PANELS]
    figure = new_figure(2.6, 2.3 * max(len(shown), 2))
    panels = np.atleast_1d(figure.subplots(1, len(shown), sharex=True, sharey=True))
    for axes, name in zip(panels, shown, strict=True):
        tidy(axes)
        truth, estimate, _ = _parts(of[name]).T / np.log(10.0)
        _diagonal(axes, truth)
        axes.scatter(truth, estimate, s=10, color=_colour(of, name), alpha=0.6, linewidths=0)
        axes.set_title(name, fontsize=SMALL)
        axes.set_xlabel("true log₁₀ E [Pa]", fontsize=SMALL)
    panels[0].set_ylabel("estimated", fontsize=SMALL)
    return figure


def calibration(of: Records) -> Figure:
    """How many true moduli lie in intervals that are stated to hold a given share."""
    figure = new_figure(3.4, 3.6 + NAMES)
    axes = figure.subplots()
    tidy(axes, grid="y")
    axes.plot([0, 1], [0, 1], color=BASELINE, linewidth=1.0, linestyle="--")
    for name, records in of.items():
        truth, estimate, spread = _parts(records).T
        stated = np.isfinite(spread)
        away = np.abs(estimate - truth)[stated] / np.maximum(spread[stated], 1e-9)
        covered = [float(np.mean(away <= norm.ppf(0.5 + level / 2.0))) for level in STATED]
        axes.plot(STATED, covered, color=_colour(of, name), label=name)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.set_xlabel("stated probability", fontsize=SMALL)
    axes.set_ylabel("share of true moduli inside", fontsize=SMALL)
    _name_lines(figure)
    return figure


def _name_lines(figure: Figure) -> None:
    """Beside the panel: the names of a dozen methods would cover their lines."""
    figure.legend(loc="outside right upper", frameon=False, fontsize=SMALL)


def _parts(records: Sequence[Record]) -> Float64[Array, "n 3"]:
    """Truth, estimate (both of ln E) and spread of each part with a known truth; NaN: no spread is stated."""
    rows = [
        (part.log_truth, part.log_estimate, np.nan if part.log_spread is None else part.log_spread)
        for record in records
        for part in record.parts
        if part.log_truth is not None
    ]
    return np.array(rows, np.float64).reshape(-1, 3)


def _diagonal(axes: Axes, along: Float64[Array, " n"]) -> None:
    ends = [float(along.min()), float(along.max())]
    axes.plot(ends, ends, color=BASELINE, linewidth=1.0, linestyle="--")


def _colour(of: Records, name: str) -> str:
    return PALETTE[list(of).index(name) % len(PALETTE)]
