"""What an object is, from how the points on it lie: a rope, a sheet or a solid."""

from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull, QhullError, cKDTree
from scipy.spatial.distance import pdist

from model.gap.bodies.neighbours import patch_normals
from model.gap.bodies.path import along, spanning_tree
from model.gap.bodies.unrolled import unrolled
from model.gap.size import size_of
from model.types import Array

Shape: TypeAlias = Literal["rope", "sheet", "solid"]

FEWEST = 20
"""With fewer points than this no surface is seen, only how markers lie."""
MARKERS = 6
"""With fewer, nothing is told: a rope."""
ONE_WAY = 0.92
"""Share of what joins all markers that leads from end to end: of those on a rope, all but noise."""
STRAIGHT, BESIDE_EACH_OTHER = 0.7, (1.3, 1.35)
"""A way from end to end that is so straight is no row after row; else markers in rows have more neighbours:
for each step of the way so many within so many steps."""
FLAT = 0.35
"""Least over middle spread of markers on a sheet."""
SLICES = 12
SLENDER = 0.05
"""Points of a slice of a rope are this near to each other, as a share of its length: 0.024 along it alone."""
NARROW = 0.75
"""Share of the slices that are so narrow: as far from an end as each other, limbs lie apart."""
THIN, THICK = 0.06, 0.25
"""Thickness of the hull over the root of half its area: below the first a sheet, above the second a solid."""
AROUND = 4
"""Points, with itself, by which a point tells how much surface it stands for."""
CLOSED = 0.58
"""A surface this large, as a share of the hull's, goes around: a flat one has half of it."""
PATCH = 9
"""Points, with itself, whose plane tells a point which way it faces."""
BESIDE, BEHIND = 1.2, (1.5, 0.35)
"""What lies behind a point: beside its normal by less than so many spacings, off its plane by more than so
many and less than such a share of the object's size."""
BACKED = 0.35
"""Share of the points behind which the object has another side: of what has limbs, whose hull is much larger
than its surface, at least 0.69 in the worlds of `benchmarks/reality`; of cloths there none."""


def guess_shape(places: Float64[Array, "N 3"]) -> Shape:
    """Rope, sheet or solid.

    Args:
        places: Points on the object [m].
    """
    if len(places) < FEWEST:
        return _of_markers(places)
    away, length = along(places)
    bins = np.clip((SLICES * away / length).astype(int), 0, SLICES - 1)
    slices = [places[bins == b] for b in range(SLICES) if (bins == b).sum() > 2]
    if not slices:  # a row of points, two at most in each
        return _of_markers(places)
    spread = [np.linalg.eigvalsh(np.cov(each.T))[-1] ** 0.5 for each in slices]
    if float(np.quantile(spread, NARROW)) < SLENDER * length:
        return "rope"
    try:
        hull = ConvexHull(places)
    except QhullError:
        return "sheet"
    thickness = 2.0 * hull.volume / hull.area / np.sqrt(hull.area / 2.0)
    if thickness < THIN:
        return "sheet"
    reach = cKDTree(places).query(places, k=AROUND)[0][:, -1]
    surface = float((np.pi * reach**2 / AROUND).sum())
    around = thickness > THICK or surface > CLOSED * hull.area or backed(places) > BACKED
    # two halves of a cloth that sags between hands face each other; but no skin of a solid unrolls
    return "solid" if around and unrolled(places) is None else "sheet"


def _of_markers(places: Float64[Array, "N 3"]) -> Shape:
    """Few points in a row are on a rope, else on a sheet where they are flat."""
    if len(places) < MARKERS:
        return "rope"
    tree, apart = spanning_tree(places), pdist(places)
    steps = tree[np.triu_indices(len(tree), 1)]
    whole, steps = float(steps.sum()), steps[steps > 0]
    most, within = BESIDE_EACH_OTHER
    beside = int((apart < within * np.median(steps)).sum()) / len(steps)
    one_way = float(dijkstra(tree).max()) >= ONE_WAY * whole
    if one_way and (float(apart.max()) >= STRAIGHT * whole or beside <= most):
        return "rope"
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(places.T)).clip(0))
    return "sheet" if spread[0] < FLAT * spread[1] else "solid"


def backed(places: Float64[Array, "N 3"]) -> float:
    """Share of the points behind which, across the object, there are others: its thickness away.

    Args:
        places: Points on the object [m], more than `PATCH`.
    """
    distance, near = cKDTree(places).query(places, k=PATCH)
    spacing = float(np.median(distance[:, AROUND - 1]))
    normal = patch_normals(places[near])
    way = places[None] - places[:, None]
    off = np.abs((way * normal[:, None]).sum(-1))
    beside = np.sqrt(np.maximum((way**2).sum(-1) - off**2, 0.0))
    farthest = BEHIND[1] * size_of(places)
    behind = (beside < BESIDE * spacing) & (off > BEHIND[0] * spacing) & (off < farthest)
    return float(behind.any(1).mean())
