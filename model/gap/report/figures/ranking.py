"""The effects by probability; those that this observation cannot tell apart are bracketed."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from model.gap.report.findings import Findings
from model.gap.report.style import BASELINE, EFFECT, INK, NORMAL, SMALL, new_figure, tidy
from model.gap.report.wording import companions, percent, plain
from model.gap.schema import GapReport

SHOWN = 6
"""Effects; the others are summed."""


@dataclass(frozen=True)
class Bar:
    """One answer and its probability."""

    name: str
    probability: float
    role: str
    """`verdict`, `class` (not to be told from it), or `other`."""


def draw(findings: Findings) -> Figure:
    """A bar for each answer, the most probable on top."""
    bars = ranked(findings.report)
    figure = new_figure(0.75 + 0.29 * len(bars))
    axes = figure.subplots()
    tidy(axes, grid="x")
    colours = {"verdict": EFFECT, "class": "#E69F00", "other": BASELINE}
    places = list(range(len(bars)))
    axes.barh(
        places, [b.probability for b in bars], color=[colours[b.role] for b in bars], height=0.68, zorder=2
    )
    for place, bar in zip(places, bars, strict=True):
        weight = "bold" if bar.role == "verdict" else "normal"
        axes.text(
            bar.probability + 0.012,
            place,
            percent(bar.probability),
            fontsize=NORMAL,
            color=INK,
            va="center",
            fontweight=weight,
        )
    axes.set_yticks(places, [bar.name for bar in bars], fontsize=NORMAL)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0 if max(b.probability for b in bars) < 0.85 else 1.12)
    axes.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "25", "50", "75", "100"])
    axes.set_xlabel("probability [%]", fontsize=SMALL, color=INK)
    _bracket(axes, bars)
    return figure


def ranked(report: GapReport) -> list[Bar]:
    """The likeliest effects, `nothing` and `something else`, and the sum of the others."""
    alike, chosen = companions(report), (report.verdict.effect, report.verdict.second)
    roles = {name: "class" for name in alike} | {name: "verdict" for name in chosen if name is not None}
    shown = [e for e in report.effects if e.name in roles]
    shown += [e for e in report.effects if e.name not in roles][: max(SHOWN - len(shown), 0)]
    bars = [Bar(plain(e.name), e.probability, roles.get(e.name, "other")) for e in shown]
    ordered = sorted([*bars, *_beside(report)], key=lambda bar: (bar.role == "other", -bar.probability))
    others = [e.probability for e in report.effects if e not in shown]
    return [*ordered, Bar(f"{len(others)} others together", sum(others), "other")] if others else ordered


def _beside(report: GapReport) -> list[Bar]:
    """The answers that are not effects."""
    rest = max(report.remainder, 0.0)
    names = {"none": "nothing is missing", "unknown": "something unknown"}
    if report.verdict.effect not in names:
        return [Bar("nothing, or unknown", rest, "other")]
    return [
        Bar(text, report.verdict.probability if name == report.verdict.effect else rest,
            "verdict" if name == report.verdict.effect else "other")
        for name, text in names.items()
    ]  # fmt: skip


def _bracket(axes: Axes, bars: Sequence[Bar]) -> None:
    """Join the bars of a class, on the right, with what joins them."""
    members = [i for i, bar in enumerate(bars) if bar.role == "class"]
    if not members:
        return
    low, high = -0.3, max(members) + 0.3
    x = max(bar.probability for bar in bars[: max(members) + 1]) + 0.17
    axes.plot([x - 0.015, x, x, x - 0.015], [low, low, high, high], color=INK, linewidth=1.2, zorder=3)
    axes.text(
        x + 0.02,
        0.5 * (low + high),
        "this recording cannot\ntell these apart",
        fontsize=SMALL,
        color=INK,
        va="center",
        linespacing=1.2,
        backgroundcolor="white",
        zorder=3,
    )
    axes.set_xlim(0.0, max(axes.get_xlim()[1], x + 0.45))
