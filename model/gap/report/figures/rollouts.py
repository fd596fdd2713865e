"""The twin without and with the effect beside the observation, at moments that are evenly spread."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from model.gap.report.findings import Findings
from model.gap.report.style import EFFECT, INK, LARGE, NORMAL, OBSERVED, REFIT, SMALL, new_figure
from model.gap.report.views import (
    FOOT,
    SMALLEST,
    View,
    bare,
    join,
    neighbours,
    scale_bar,
    spread_out,
    two_views,
)
from model.gap.report.wording import REFITTED, millimetres, stacked, with_effect
from model.types import Array

MOMENTS = 4
SHOWN = 250
"""Points; more would hide each other."""
FARTHEST = 1.5
"""From the centre of the observation, in sizes of what it covers; what is farther is not shown."""
LONELY = 1.4
"""Times as far from the centre as nearly all points that the farthest are shown."""


@dataclass(frozen=True)
class Twin:
    """One rollout to compare with the observation."""

    name: str
    rollout: Float[Array, "T N 3"]
    """[m]."""
    colour: str


def draw(findings: Findings) -> Figure:
    """Moments down, twins across; of a single twin two moments in each row, and its name over both."""
    twins = [Twin(REFITTED, findings.before, REFIT)]
    if findings.after is not None:
        twins.append(Twin(with_effect(findings.report), findings.after, EFFECT))
    frames = moments(findings)
    alone = len(twins) == 1
    rows = [frames[i : i + 2] for i in range(0, len(frames), 2)] if alone else [[frame] for frame in frames]
    view = two_views(_seen(findings.observed))[0]
    half = _half(findings, view, frames)
    height = min(max(2.45 * half[1] / half[0], 1.0), 1.9)
    figure = new_figure(0.9 + len(rows) * height)
    feet = [0.0] * (len(rows) - 1) + [FOOT]
    grid = figure.subplots(len(rows), 2, squeeze=False, height_ratios=[2.0 + foot for foot in feet])
    for panels, moment, foot in zip(grid, rows, feet, strict=True):
        cells = [(frame, twin) for frame in moment for twin in twins]
        for axes, (frame, twin) in zip(panels, cells, strict=False):
            _moment(axes, findings, view, frame, twin)
            bare(axes, _centre(findings, view, frame), half, foot)
            if alone or axes is panels[0]:
                axes.set_ylabel(
                    _label(findings, frame),
                    fontsize=NORMAL,
                    color=INK,
                    rotation=0,
                    labelpad=4,
                    va="center",
                    ha="right",  # a long time makes the picture narrower instead of lying on it
                    multialignment="center",
                )
        for axes in panels[len(cells) :]:
            axes.set_axis_off()
    if alone:
        figure.suptitle(stacked(twins[0].name), fontsize=LARGE, color=twins[0].colour, fontweight="bold")
    for axes, twin in zip(grid[0], [] if alone else twins, strict=False):
        axes.set_title(stacked(twin.name), fontsize=LARGE, color=twin.colour, fontweight="bold", pad=18)
    scale_bar(grid[-1][0])
    figure.legend(handles=_key(), loc="outside lower right", ncols=2, frameon=False, fontsize=SMALL)
    return figure


def moments(findings: Findings) -> list[int]:
    """Frames in the middle of equal quarters of the recording, or the best seen ones next to them."""
    quarters = np.array_split(np.arange(len(findings.times)), MOMENTS)
    seen = findings.visible()
    chosen = []
    for quarter in quarters:
        if not len(quarter) or not seen[quarter].max() > 0:
            continue
        good = quarter[seen[quarter] >= 0.9 * seen[quarter].max()]
        chosen.append(int(good[np.abs(good - quarter.mean()).argmin()]))
    return chosen


def _moment(axes: Axes, findings: Findings, view: View, frame: int, twin: Twin) -> None:
    """Observation dark, twin in colour, and a line for what lies between them."""
    colour, model = twin.colour, twin.rollout[frame]
    shown = spread_out(findings.rest, SHOWN)
    seen = view(findings.observed[frame, shown].astype(np.float64))
    rings = view(model[shown].astype(np.float64))
    join(axes, rings, neighbours(findings.rest[shown]), colour=f"{colour}40", width=0.7)
    apart = np.stack([seen, rings], 1)
    apart = apart[np.isfinite(apart).all((1, 2))]
    axes.add_collection(LineCollection(list(apart), colors=f"{colour}90", linewidths=0.7, zorder=2))
    size = float(np.clip(2400.0 / len(rings), 3.0, 22.0))
    axes.scatter(
        rings[:, 0], rings[:, 1], s=size, facecolors="white", edgecolors=colour, linewidths=0.9, zorder=3
    )
    axes.scatter(seen[:, 0], seen[:, 1], s=0.3 * size, color=OBSERVED, linewidths=0, zorder=4)
    distance = np.linalg.norm(findings.observed[frame] - model, axis=-1)
    axes.annotate(
        f"{millimetres(float(np.nanmean(distance)))} off",
        (0.5, 1.0),
        (0, 3),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=SMALL,
        color=INK,
        ha="center",
        va="bottom",
    )


def _key() -> list[Line2D]:
    """What dots and rings are."""
    dot = Line2D([], [], linestyle="", marker="o", markersize=3, color=OBSERVED, label="observed")
    ring = Line2D(
        [], [], linestyle="", marker="o", markersize=5, color=INK, markerfacecolor="white", label="twin"
    )
    return [dot, ring]


def _label(findings: Findings, frame: int) -> str:
    """The moment, and whether a fit has seen it."""
    time = float(findings.times[frame])
    held = any(start <= time <= end for start, end in findings.report.gap.heldout)
    return f"{time:.2f} s\nheld out" if held else f"{time:.2f} s"


def _seen(observed: Float[Array, "T N 3"]) -> Float[Array, "m 3"]:
    flat = observed.reshape(-1, 3)
    seen: Float[Array, "m 3"] = flat[np.isfinite(flat).all(-1)].astype(np.float64)
    return seen


def _centre(findings: Findings, view: View, frame: int) -> Float[Array, "2"]:
    places = view(_seen(findings.observed[frame : frame + 1]))
    return np.asarray(0.5 * (places.min(0) + places.max(0)))


def _half(findings: Findings, view: View, frames: list[int]) -> Float[Array, "2"]:
    """Half of the width and height of every panel [m]: the observation and most of each twin fit in."""
    seen = view(_seen(findings.observed[frames]))
    reach, limit = [], FARTHEST * np.ptp(seen, axis=0).max()
    for frame in frames:
        clouds = [findings.observed[frame], findings.before[frame]]
        clouds += [] if findings.after is None else [findings.after[frame]]
        away = np.abs(view(_seen(np.stack(clouds))) - _centre(findings, view, frame))
        # a few points beside the object belong into the picture, one that flew away does not
        reach.append(np.minimum(away.max(0), LONELY * np.quantile(away, 0.98, axis=0)))
    most = np.minimum(np.max(reach, axis=0), limit)  # a twin that flew away leaves the panel
    return np.asarray(np.maximum(np.maximum(1.06 * most, 0.35 * most.max()), SMALLEST))
