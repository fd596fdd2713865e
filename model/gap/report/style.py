"""How all figures look: colours that colour-blind people tell apart, few lines, large letters.

Reference:
    Okabe and Ito (2008), Color Universal Design, for the categorical colours.
"""

import io

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure

OBSERVED = "#222222"
BASELINE = "#8c8c8c"
REFIT = "#0072B2"
EFFECT = "#D55E00"
FLOOR = "#56B4E9"
CEILING = "#009E73"
INK = "#222222"
MUTED = "#666666"
FAINT = "#d9d9d9"
BAND = "#eef1f5"
WIDTH = 5.6
"""Inches: narrow, so that letters stay readable on a phone."""
SMALL, NORMAL, LARGE = 9.0, 10.0, 11.5
"""Letters [pt]."""
DPI = 200


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of this size [inch]."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")


def tidy(axes: Axes, grid: str | None = None) -> None:
    """Leave the lines that carry something; `grid` is the axis whose values are worth following."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
    axes.tick_params(colors=INK, labelsize=SMALL, color=MUTED)
    if grid == "y":
        axes.yaxis.grid(True, color=FAINT, linewidth=0.7)
    if grid == "x":
        axes.xaxis.grid(True, color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)


def scale_of(name: str) -> Colormap:
    """A perceptually uniform scale, light for little and dark for much, visible on white throughout."""
    whole = mpl.colormaps[name]
    return ListedColormap([whole(0.93 - 0.83 * i / 199) for i in range(200)], name=f"{name}_on_white")


GAP_SCALE = scale_of("magma")
ACTION_SCALE = scale_of("viridis")


def png(figure: Figure) -> bytes:
    """The figure as a PNG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
