"""How far the gap shrinks: bars of baseline, refit, with effect, ceiling and floor, with intervals."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from model.gap.report.findings import Findings
from model.gap.report.style import (
    BASELINE,
    CEILING,
    EFFECT,
    FLOOR,
    INK,
    LARGE,
    MUTED,
    NORMAL,
    REFIT,
    SMALL,
    new_figure,
    tidy,
)
from model.gap.report.wording import REFITTED, millimetres, percent, percent_range, stacked, with_effect
from model.gap.schema import Closure, GapReport

ROUNDS = 8
"""Until the room for what is written is about right."""


def draw(findings: Findings) -> Figure:
    """The bars of this recording, and below them those of the second interaction."""
    report = findings.report
    panels: list[tuple[str, Closure, Mapping[str, tuple[float, float]]]] = [
        ("Held-out time of this recording", report.gap, findings.intervals)
    ]
    if report.gap.transfer is not None:
        panels.append(("Another interaction", report.gap.transfer, findings.transfer_intervals))
    rows = [len(_bars(report, closure)) for _, closure, _ in panels]
    figure = new_figure(0.45 + sum(0.55 + 0.34 * count for count in rows))
    ends = [end for _, closure, known in panels for end in _ends(_bars(report, closure), known).values()]
    reach = 1e3 * max(high for _, high in ends)
    each = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=rows)[:, 0]
    for axes, (title, closure, intervals) in zip(each, panels, strict=True):
        _panel(axes, report, closure, intervals, reach)
        axes.set_title(title, fontsize=LARGE, color=INK, fontweight="bold", loc="left")
    each[-1].set_xlabel("mean distance of visible points [mm]", fontsize=SMALL, color=INK)
    _make_room(figure, list(each))
    return figure


def _make_room(figure: Figure, each: list[Axes]) -> None:
    """Widen the axes until what is written behind the bars fits into them."""
    least = right = each[0].get_xlim()[1]
    for _ in range(ROUNDS):  # room for the text leaves less for the bars, and the layout follows
        figure.draw_without_rendering()
        wide = each[0].get_window_extent().width
        ends = [
            text.get_position()[0] + 1.02 * right * text.get_window_extent().width / wide
            for axes in each
            for text in axes.texts
        ]
        right = max(least, *ends)
        each[0].set_xlim(0.0, right)


def _bars(report: GapReport, closure: Closure) -> list[tuple[str, str, float, str]]:
    """Key, name, value [m] and colour of each bar there is."""
    named = {
        "baseline": ("as it came", closure.baseline, BASELINE),
        "refit": (REFITTED, closure.refit, REFIT),
        "with_effect": (with_effect(report), closure.with_effect, EFFECT),
        "ceiling": ("with any force", closure.ceiling, CEILING),
        "noise_floor": ("noise floor", closure.noise_floor, FLOOR),
    }
    return [(key, name, value, colour) for key, (name, value, colour) in named.items() if value is not None]


def _ends(
    bars: Sequence[tuple[str, str, float, str]], intervals: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Where the interval of each bar ends [m], by its key."""
    return {key: intervals.get(key, (value, value)) for key, _, value, _ in bars}


def _panel(
    axes: Axes,
    report: GapReport,
    closure: Closure,
    intervals: Mapping[str, tuple[float, float]],
    reach: float,
) -> None:
    """One set of bars; `reach` [mm] is where the farthest of all sets ends."""
    tidy(axes, grid="x")
    bars = _bars(report, closure)
    ends = _ends(bars, intervals)
    for place, (key, _, value, colour) in enumerate(bars):
        low, high = (1e3 * end for end in ends[key])
        axes.barh(place, 1e3 * value, color=colour, height=0.66, zorder=2)
        if key in intervals:
            axes.plot(
                [low, high], [place, place], color=INK, linewidth=1.4, marker="|", markersize=7, zorder=3
            )
        text = axes.text(
            max(high, 1e3 * value) + 0.02 * reach,
            place,
            millimetres(value),
            fontsize=NORMAL,
            color=INK,
            va="center",
        )
        if key == "with_effect" and closure.closed_fraction is not None:
            text.set_text(f"{millimetres(value)}   {_closed(closure)}")
            text.set_fontweight("bold")
    axes.set_yticks(range(len(bars)), [stacked(name) for _, name, _, _ in bars], fontsize=NORMAL)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(bars) - 0.5, -0.5)
    axes.set_xlim(0.0, max(1.18 * reach, axes.get_xlim()[1]))
    axes.xaxis.label.set_color(MUTED)


def _closed(closure: Closure) -> str:
    """`closes 85 % (81–88 %)`."""
    assert closure.closed_fraction is not None
    text = f"closes {percent(closure.closed_fraction)}"
    interval = closure.closed_fraction_ci95
    return text if interval is None else f"{text} ({percent_range(interval)})"
