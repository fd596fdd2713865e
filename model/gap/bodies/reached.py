"""A body that reaches a hand which holds it from afar: nothing was seen of what is between."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial.distance import cdist, pdist

from model.gap.bodies.guess import FEWEST
from model.observation_doubts import hangs
from model.types import Array, Observation

POINTS = 110
"""In the body, at most about."""
THINNEST = 0.25
"""Of its greater thickness: how thin a body is of which nothing but markers in a plane are known."""
SLENDER = 0.1
"""A rope is thinner than this share of its length."""
FINER = 1.02
"""Spacings are grown by this factor until points are few enough."""
CENTRED = 4
"""Times that the way from end to end is found, each across the last."""
UPRIGHT = 1e-3
BEHIND = 0.5
"""Of the girth: how far the body goes on behind the hand."""


def held_from_afar(observation: Observation, places: Float64[Array, "N 3"]) -> bool:
    """Whether a hand holds an object of which a few points are seen, all of them far from the hand.

    Few: no surface is seen of it. Far: all controllers are farther from them than they are from each other,
    so that they say nothing of the body between. Held: without the controllers it would be in the air, and it
    does not fall. What all lies in a row is a rope, which reaches its hand by itself.

    Args:
        observation: What was seen.
        places: Seen points in its first frame [m].
    """
    controllers = observation.controllers[0].astype(np.float64)
    if not len(controllers) or not 2 < len(places) < FEWEST:
        return False
    size = float(pdist(places).max())
    # hands on both sides may be far from all points, and yet their middle is among them
    if min(cdist(places, controllers).min(), np.linalg.norm(places.mean(0) - controllers.mean(0))) <= size:
        return False
    sides = _box(places, controllers)[2]
    if sides[1:].max() < SLENDER * sides[0]:
        return False
    return hangs(replace(observation, controllers=observation.controllers[:, :0]))


@dataclass(frozen=True)
class Bar:
    """Mass points from a hand to what is seen."""

    points: Float64[Array, "P 3"]
    """[m]."""
    share: Float64[Array, " P"]
    """Of the mass, sums to 1."""
    spacing: float
    """[m]."""
    girth: float
    """Half the diagonal of its section [m]: a hand that holds so much holds its end."""


def bar(places: Float64[Array, "N 3"], controllers: Float64[Array, "C 3"], scale: float) -> Bar:
    """A straight bar from the hand to the farthest seen point.

    The bar is as thick all along as what is seen of it, for nothing says where it is thinner, and controllers
    are on the hand, not on it. Its sides are upright and level, so that its weight bends it downwards and not
    aside. It has two layers at least: one alone would not resist bending. A hand holds some of it before, and
    as much behind, what is known of the hand: else the bar would bend in too short a piece.

    Args:
        places: Seen points [m].
        controllers: In the first frame [m].
        scale: Of the spacing.
    """
    axes, low, size = _box(places, controllers)
    thick = np.maximum(size, [0.0, *2 * [THINNEST * size[1:].max()]])
    low, size = low - 0.5 * (thick - size), thick
    girth = 0.5 * float(np.linalg.norm(size[1:]))
    low[0] -= BEHIND * girth
    size[0] += BEHIND * girth
    spacing = scale * _spacing(size)
    counts = _counts(size, spacing)
    lines = [begin + np.linspace(0.0, side, n) for begin, side, n in zip(low, size, counts, strict=True)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3) @ axes
    # half a cell belongs to a point of a face: else an end would be heavier than the middle
    cells = [np.where((np.arange(n) == 0) | (np.arange(n) == n - 1), 0.5, 1.0) for n in counts]
    share = np.prod(np.stack(np.meshgrid(*cells, indexing="ij"), -1), -1).reshape(-1)
    return Bar(points, share / share.sum(), float(np.mean(size / (counts - 1))), girth)


def _box(
    places: Float64[Array, "N 3"], controllers: Float64[Array, "C 3"]
) -> tuple[Float64[Array, "3 3"], Float64[Array, "3"], Float64[Array, "3"]]:
    """Axes of the bar, where along these it begins, and its sides [m], of what is seen and up to the hand."""
    axes = _axes(places, controllers)
    own, hand = places @ axes.T, controllers @ axes.T
    low = own.min(0)
    low[0] = hand[:, 0].min()
    return axes, low, own.max(0) - low


def _axes(places: Float64[Array, "N 3"], controllers: Float64[Array, "C 3"]) -> Float64[Array, "3 3"]:
    """Along the bar, level across it, and upright as far as it lies; rows.

    The way leads from the middle of the one end to that of the other, each halfway between what is farthest
    apart across it: means would be drawn to where markers happen to be close together.
    """
    along = places.mean(0) - controllers.mean(0)
    for _ in range(CENTRED):
        first = along / np.linalg.norm(along)
        level = np.cross([0.0, 0.0, 1.0], first)
        if np.linalg.norm(level) < UPRIGHT:  # it hangs or stands: any direction is level
            level = np.cross([0.0, 1.0, 0.0], first)
        level /= np.linalg.norm(level)
        axes = np.stack([first, level, np.cross(first, level)])
        ends = [each @ axes.T for each in (places, controllers)]
        tip, hand = ((end.min(0) + end.max(0)) / 2.0 for end in ends)
        along = (tip - hand) @ axes
    return axes


def _counts(size: Float64[Array, "3"], spacing: float) -> Int64[Array, "3"]:
    counts: Int64[Array, 3] = np.maximum(np.round(size / spacing), 1).astype(np.int64) + 1
    return counts


def _spacing(size: Float64[Array, "3"]) -> float:
    """The finest [m] with no more than `POINTS` points."""
    spacing: float = (float(size.prod()) / POINTS) ** (1 / 3)
    while int(_counts(size, spacing).prod()) > POINTS:
        spacing *= FINER
    return spacing
