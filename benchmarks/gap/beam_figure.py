"""The tip of a beam over time, seen and foretold."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure

from benchmarks.gap.swing import LOOKED_AT
from model.gap.report.style import BASELINE, EFFECT, FLOOR, NORMAL, OBSERVED, REFIT, SMALL, new_figure, tidy
from model.types import Array

LOOKS = {
    "observed": (OBSERVED, "-", 2.2),
    "observed again": (FLOOR, "-", 1.2),
    "twin": (REFIT, "-", 1.4),
    "twin without the load": (BASELINE, "--", 1.2),
    "twin with the known load": (REFIT, "-", 1.4),
    "twin with the load that fits": (EFFECT, ":", 1.6),
}


@dataclass(frozen=True)
class Line:
    """The height of the tip."""

    times: Float64[Array, " T"]
    """Since it was let go [s]."""
    height: Float64[Array, " T"]
    """Above where it was held [m]."""


def draw(panels: Mapping[str, Mapping[str, Line]]) -> Figure:
    """One panel above the other, on one scale.

    Args:
        panels: By title; the lines of each by what they are.
    """
    figure = new_figure(2.3 * len(panels) + 0.4, 7.2)
    every = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, lines) in zip(every, panels.items(), strict=True):
        for name, line in lines.items():
            color, dashes, width = LOOKS[name]
            early = line.times <= LOOKED_AT
            axes.plot(
                line.times[early], 1e3 * line.height[early], dashes, color=color, linewidth=width, label=name
            )
        axes.set_title(title, fontsize=NORMAL, loc="left")
        axes.set_ylabel("tip, mm", fontsize=SMALL)
        axes.legend(fontsize=SMALL, frameon=False, loc="upper right", ncols=2)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.35 * (high - low))
        tidy(axes, "y")
    every[-1].set_xlabel("seconds since it was let go", fontsize=SMALL)
    every[-1].set_xlim(0.0, LOOKED_AT)
    return figure


def tip(times: Float64[Array, " T"], points: Float64[Array, "T N 3"]) -> Line:
    """The mean height of markers, from the first frame on."""
    height = points[..., 2].mean(1)
    return Line(times - times[0], np.asarray(height - height[0], np.float64))
