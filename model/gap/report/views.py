"""From where a figure looks at the object: parallel views that need no axes, only a scale and an up."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from scipy.spatial import cKDTree

from model.gap.report.style import FAINT, INK, MUTED, SMALL
from model.types import Array

NEIGHBOURS = 5
OBLIQUE = math.radians(25.0)
ELEVATION = math.radians(18.0)
SMALLEST = 1e-3
"""Half of a picture [m]; a single point is shown as well."""
FOOT = 0.2
"""Room below an object, in half heights of the picture."""
STEEP = math.radians(50.0)
"""Elevation over what lies flat."""


@dataclass(frozen=True)
class View:
    """A direction to look from."""

    right: Float[Array, "3"]
    up: Float[Array, "3"]
    towards: Float[Array, "3"]
    """From the object to the eye."""

    @classmethod
    def of(cls, azimuth: float, elevation: float) -> "View":
        """From the side `azimuth` [rad], raised by `elevation` [rad]."""
        level = math.cos(elevation)
        towards = np.array(
            [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)], np.float64
        )
        right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        return cls(right, np.cross(towards, right), towards)

    def __call__(self, points: Float[Array, "*b 3"]) -> Float[Array, "*b 2"]:
        """Places in the picture [m]."""
        places: Float[Array, "*b 2"] = points @ np.stack([self.right, self.up], -1)
        return places

    def order(self, points: Float[Array, "N 3"]) -> Array:
        """Indices from the farthest to the nearest."""
        return np.argsort(points @ self.towards, kind="stable")


def two_views(points: Float[Array, "N 3"]) -> tuple[View, View]:
    """Two views of an object that together show all of it: across its length, and from behind.

    Args:
        points: Finite places [m] that tell its length and height.
    """
    centred = points - points.mean(0)
    _, ways = np.linalg.eigh(centred[:, :2].T @ centred[:, :2])
    across = math.atan2(ways[1, 0], ways[0, 0])
    flat = np.ptp(centred[:, 2]) < 0.35 * max(np.ptp(centred @ np.append(ways[:, 1], 0.0)), 1e-9)
    elevation = STEEP if flat else ELEVATION
    return View.of(across + OBLIQUE, elevation), View.of(across + OBLIQUE + math.radians(130.0), elevation)


def neighbours(points: Float[Array, "N 3"]) -> Array:
    """Pairs [E, 2] of near points, which show a cloud's shape when they are joined."""
    count = min(NEIGHBOURS, len(points))
    if count < 2:
        return np.zeros((0, 2), np.int64)
    distance, index = cKDTree(points).query(points, k=count)
    near = distance[:, 1:] <= 1.3 * np.median(distance[:, 1])
    start = np.broadcast_to(np.arange(len(points))[:, None], near.shape)[near]
    pairs: Array = np.unique(np.sort(np.stack([start, index[:, 1:][near]], -1), axis=1), axis=0)
    return pairs


def spread_out(points: Float[Array, "N 3"], count: int) -> Array:
    """Indices [≤ count] of points that cover the cloud evenly: each the farthest from those before it."""
    if len(points) <= count:
        return np.arange(len(points))
    chosen = [int(np.linalg.norm(points - points.mean(0), axis=1).argmax())]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < count:
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(nearest.argmax()))
    return np.sort(np.array(chosen))


def join(
    axes: Axes, places: Float[Array, "N 2"], pairs: Array, colour: str = FAINT, width: float = 0.8
) -> None:
    """Draw a line between each pair of places, where both are finite."""
    lines = places[pairs]
    lines = lines[np.isfinite(lines).all((1, 2))]
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, zorder=1))


def bare(axes: Axes, centre: Float[Array, "2"], half: Float[Array, "2"], foot: float = FOOT) -> None:
    """Show this part of the picture, one to one, without axes; below it stays room for a scale.

    Args:
        axes: To draw on.
        centre: Middle of the part [m].
        half: Half of its width and height [m].
        foot: The room below, in half heights.
    """
    half = np.maximum(half, SMALLEST)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(centre[0] - half[0], centre[0] + half[0])
    axes.set_ylim(centre[1] - (1.0 + foot) * half[1], centre[1] + half[1])
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)


def scale_bar(axes: Axes) -> None:
    """A bar of a round length in the lower left corner."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    length = _round_length(0.3 * (right - left))
    y = bottom + 0.25 * FOOT / (2.0 + FOOT) * (top - bottom)
    axes.plot([left, left + length], [y, y], color=INK, linewidth=2.0, solid_capstyle="butt", clip_on=False)
    text = (
        f"{length:g} m"
        if length >= 1
        else f"{100 * length:g} cm"
        if length >= 0.01
        else f"{1e3 * length:g} mm"
    )
    axes.annotate(
        text, (left + length, y), (4, 0), textcoords="offset points", fontsize=SMALL, color=MUTED, va="center"
    )


def _round_length(most: float) -> float:
    """The largest of 1, 2, 5 × 10ⁿ that is not above `most`."""
    power = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * (1 + 1e-9))
