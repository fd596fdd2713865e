"""The object, coloured by where the gap lies and by where the effect acts."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from model.gap.report.findings import Findings
from model.gap.report.style import ACTION_SCALE, GAP_SCALE, INK, LARGE, MUTED, SMALL, new_figure
from model.gap.report.views import View, bare, join, neighbours, scale_bar, two_views
from model.gap.report.wording import plain
from model.types import Array

VIEW_NAMES = ("from the front", "from behind")


def draw(findings: Findings) -> Figure:
    """Two views of the object at rest; a row for the gap, and one for the effect where there is one."""
    where = findings.report.where
    share = np.array(where.points) * len(where.points)
    rows = [("Where the gap lies", share, _top(share), GAP_SCALE, "gap (average point: 1)")]
    if any(where.acts_on):
        named = findings.report.named
        title = f"Where {'it' if named is None else plain(named.name)} acts"
        rows.append((title, np.array(where.acts_on), 1.0, ACTION_SCALE, "strength (strongest: 1)"))
    views = two_views(findings.rest)
    figure = new_figure(_height(findings.rest, views) * len(rows))
    blocks = figure.subfigures(len(rows), 1, squeeze=False)[:, 0]
    for block, row in zip(blocks, rows, strict=True):
        title, values, top, colours, label = row
        panels = block.subplots(1, 2)
        for axes, view, name in zip(panels, views, VIEW_NAMES, strict=True):
            _object(axes, findings, view, values, top, colours)
            axes.set_title(name, fontsize=SMALL, color=MUTED)
        block.suptitle(title, fontsize=LARGE, color=INK, fontweight="bold", x=0.02, ha="left")
        scale_bar(panels[0])
        bar = block.colorbar(
            ScalarMappable(Normalize(0.0, top), colours), ax=list(panels), shrink=0.75, aspect=18, pad=0.02
        )
        bar.set_label(label, fontsize=SMALL, color=INK)
        bar.ax.tick_params(labelsize=SMALL, colors=INK)
        bar.outline.set_visible(False)
    return figure


def _object(
    axes: Axes, findings: Findings, view: View, values: Float[Array, " N"], top: float, colours: Colormap
) -> None:
    places = view(findings.rest)
    join(axes, places, neighbours(findings.rest))
    order = view.order(findings.rest)
    axes.scatter(
        places[order, 0],
        places[order, 1],
        c=values[order],
        cmap=colours,
        vmin=0.0,
        vmax=top,
        s=_size(len(places)),
        linewidths=0.3,
        edgecolors="white",
        zorder=2,
    )
    if len(hands := _hands(findings)):
        held = view(hands)
        axes.scatter(
            held[:, 0], held[:, 1], s=60, facecolors="none", edgecolors=INK, linewidths=1.2, zorder=4
        )
        highest = held[held[:, 1].argmax()]
        axes.annotate(
            "held here", highest, (0, 6), textcoords="offset points", fontsize=SMALL, color=INK, ha="center"
        )
    every = np.concatenate([places, view(hands)])
    low, high = every.min(0), every.max(0)
    bare(axes, (low + high) / 2, 0.5 * (high - low) + 0.12 * (high - low).max())


def _hands(findings: Findings) -> Float[Array, "C 3"]:
    """Where the hand is in the first frame that knows it."""
    known = np.isfinite(findings.controllers).all((1, 2))
    return findings.controllers[known.argmax()] if known.any() else np.zeros((0, 3))


def _height(rest: Float[Array, "N 3"], views: tuple[View, View]) -> float:
    """Of a row [inch], so that the object fills it."""
    extents = [np.ptp(view(rest), axis=0) for view in views]
    ratio = max(float(extent[1] / max(extent[0], 1e-9)) for extent in extents)
    return 0.8 + 2.1 * min(max(ratio, 0.5), 1.5)


def _size(count: int) -> float:
    """Of a dot [pt²]: fewer points, larger dots."""
    return float(np.clip(7000.0 / max(count, 1), 6.0, 60.0))


def _top(share: Float[Array, " N"]) -> float:
    """End of the scale: nearly the largest, at least twice the average, so that evenness looks even."""
    return max(2.0, float(np.quantile(share, 0.99)))
