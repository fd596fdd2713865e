"""A sheet: points on it."""

import numpy as np
from jaxtyping import Float64

from model.gap.bodies.neighbours import farthest_points, usual_distance
from model.types import Array

SHEET_POINTS = 240
"""On a sheet, at most about."""


def net(places: Float64[Array, "N 3"], scale: float) -> tuple[Float64[Array, "P 3"], float]:
    """Points, and their spacing [m].

    Args:
        places: Seen points [m].
        scale: Of the spacing.
    """
    size = np.sqrt(np.linalg.eigvalsh(np.cov(places.T)).clip(0) * 12.0)
    spacing = scale * max(usual_distance(places), float(np.sqrt(size[2] * size[1] / SHEET_POINTS)))
    points: Float64[Array, "P 3"] = places[farthest_points(places, 0.8 * spacing)]
    return points, max(spacing, usual_distance(points))
