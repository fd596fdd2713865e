"""What an object is, from how the points on it lie: a rope, a sheet or a solid."""

from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError, cKDTree

from model.gap.bodies.path import along
from model.types import Array

Shape: TypeAlias = Literal["rope", "sheet", "solid"]

FEWEST = 20
"""With fewer points than this no surface is seen; those in a row are markers on a rope."""
SLICES = 12
SLENDER = 0.05
"""Points of a slice of a rope are this near to each other, as a share of its length: 0.024 along it alone."""
THIN, THICK = 0.06, 0.25
"""Thickness of the hull over the root of half its area: below the first a sheet, above the second a solid."""
AROUND = 4
"""Points, with itself, by which a point tells how much surface it stands for."""
CLOSED = 0.58
"""A surface this large, as a share of the hull's, goes around: a flat one has half of it, and what has limbs
or hollows less than all."""


def guess_shape(places: Float64[Array, "N 3"]) -> Shape:
    """Rope, sheet or solid.

    Args:
        places: Points on the object [m].
    """
    away, length = along(places)
    if len(places) < FEWEST:
        return "rope"
    bins = np.clip((SLICES * away / length).astype(int), 0, SLICES - 1)
    slices = [places[bins == b] for b in range(SLICES) if (bins == b).sum() > 2]
    spread = [np.linalg.eigvalsh(np.cov(each.T))[-1] ** 0.5 for each in slices]
    if float(np.median(spread)) < SLENDER * length:
        return "rope"
    try:
        hull = ConvexHull(places)
    except QhullError:
        return "sheet"
    thickness = 2.0 * hull.volume / hull.area / np.sqrt(hull.area / 2.0)
    if thickness < THIN or thickness > THICK:
        return "sheet" if thickness < THIN else "solid"
    reach = cKDTree(places).query(places, k=AROUND)[0][:, -1]
    surface = float((np.pi * reach**2 / AROUND).sum())
    return "solid" if surface > CLOSED * hull.area else "sheet"
