"""The gap over time: as it came, refitted, with the effect; phases shaded, held-out spans marked."""

from itertools import product
from textwrap import fill

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import blended_transform_factory

from model.gap.report.findings import Findings
from model.gap.report.style import BAND, BASELINE, EFFECT, FLOOR, INK, REFIT, SMALL, new_figure, tidy
from model.gap.report.wording import REFITTED, percent, plain, stacked, with_effect
from model.types import Array

MARGIN = 1.5
"""Between a phase's name and its ends [pt]; a phase too narrow for its name gets none."""
LETTERS = (SMALL - 0.5, SMALL - 1.5)
"""Of the names of phases [pt]: the larger ones where there is room."""
SHORT = 12
"""Letters in a line of a name that is too long in lines that end at its commas."""

FARTHEST = 4.0
"""In largest errors of the refitted twin; a twin that came with more is cut off."""


def draw(findings: Findings) -> Figure:
    """One line for each twin, in millimetres over seconds."""
    figure = new_figure(3.5)
    axes = figure.subplots()
    tidy(axes, grid="y")
    report, times = findings.report, findings.times
    lines = [("as it came", findings.error_baseline, BASELINE), (REFITTED, findings.error_refit, REFIT)]
    if findings.error_after is not None:
        lines.append((with_effect(report), findings.error_after, EFFECT))
    for name, error, colour in lines:
        axes.plot(times, 1e3 * error, color=colour, linewidth=1.8, label=stacked(name), zorder=3)
    axes.axhline(
        1e3 * report.gap.noise_floor,
        color=FLOOR,
        linewidth=1.2,
        linestyle=(0, (4, 2)),
        label="noise floor",
        zorder=2,
    )
    axes.set_xlim(times[0], times[-1])
    axes.set_ylim(0.0, _top([error for _, error, _ in lines]))
    axes.set_xlabel("time [s]", fontsize=SMALL, color=INK)
    axes.set_ylabel("mean distance of visible points [mm]", fontsize=SMALL, color=INK)
    _phases(axes, findings)
    _heldout(axes, findings)
    figure.legend(
        *axes.get_legend_handles_labels(),
        loc="outside upper left",
        ncols=4,
        frameon=False,
        fontsize=SMALL,
        handlelength=1.4,
        columnspacing=1.2,
    )
    _names(figure, axes, findings)
    return figure


def _phases(axes: Axes, findings: Findings) -> None:
    """Every other phase on a band."""
    for phase in findings.report.where.phases[::2]:
        axes.axvspan(phase.start_s, phase.end_s, color=BAND, linewidth=0, zorder=0)


def _names(figure: Figure, axes: Axes, findings: Findings) -> None:
    """Each phase's name and share of the gap at its top, where there is room; after all else is placed."""
    over = blended_transform_factory(axes.transData, axes.transAxes)
    figure.draw_without_rendering()  # where the axes are, is only known now
    margin = 2.0 * MARGIN * figure.dpi / 72.0
    for phase in findings.report.where.phases:
        start, end = max(phase.start_s, findings.times[0]), min(phase.end_s, findings.times[-1])
        text = axes.text(
            0.5 * (start + end),
            0.985,
            "",
            transform=over,
            color=INK,
            ha="center",
            va="top",
            zorder=4,
            linespacing=1.3,
        )
        text.set_in_layout(False)
        left, right = axes.transData.transform([(start, 0.0), (end, 0.0)])[:, 0]
        if not _fits(text, plain(phase.name), percent(phase.share), right - left - margin):
            text.remove()


def _fits(text: Text, name: str, share: str, room: float) -> bool:
    """Whether some letters and lines of a name, with its share below, are no wider than this [pixels]."""
    for size, lines in product(LETTERS, (name.replace(", ", ",\n"), fill(name, SHORT))):
        text.set(text=f"{lines}\n{share}", fontsize=size)
        if text.get_window_extent().width <= room:
            return True
    return False


def _heldout(axes: Axes, findings: Findings) -> None:
    """A bar above the picture where no fit has looked."""
    over = blended_transform_factory(axes.transData, axes.transAxes)
    begin, last = findings.times[0], findings.times[-1]
    spans = [(max(start, begin), min(end, last)) for start, end in findings.report.gap.heldout]
    for index, (start, end) in enumerate(span for span in spans if span[0] < span[1]):
        axes.plot(
            [start, end],
            [1.03, 1.03],
            transform=over,
            color=INK,
            linewidth=4.0,
            solid_capstyle="butt",
            clip_on=False,
        )
        if index == 0:
            late = start - begin > 0.5 * (last - begin)
            axes.text(
                end if late else start,
                1.05,
                "held out: judged, not fitted",
                transform=over,
                fontsize=SMALL,
                color=INK,
                ha="right" if late else "left",
                va="bottom",
            )


def _top(errors: list[Float[Array, " T"]]) -> float:
    """Of the axis [mm]: room for the names of the phases; a twin that came far off leaves the picture."""
    finite = [error[np.isfinite(error)] for error in errors]
    largest = [float(error.max()) if len(error) else 0.0 for error in finite]
    shown = min(max(largest), FARTHEST * max(largest[1:]))
    return 1.36e3 * max(shown, 1e-5)
