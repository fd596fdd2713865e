"""What a hand hides of an object: the points that it holds, where nothing was seen of them."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError, cKDTree

from model.gap.bodies.guess import Shape
from model.gap.bodies.neighbours import farthest_points
from model.types import Array

NEAR = 2.0
"""Spacings: a hand that is farther away from all that was seen holds nothing."""
FREE = 0.7
"""Spacings: a place this far from all points is not yet filled."""
AROUND = 8
"""Points that a surface is told by."""


def hidden_points(
    points: Float64[Array, "P 3"], controllers: Float64[Array, "C 3"], shape: Shape, spacing: float
) -> Float64[Array, "h 3"]:
    """Points of the object under the hand: where controllers are, brought onto the sheet or into the solid.

    Controllers are on the hand, which is thicker than what it holds: points in their own places would stand
    out of a sheet, hang below the ground and turn with nothing but the hand.

    Args:
        points: Of the object, made from what was seen [m].
        controllers: In the first frame [m].
        shape: Of the object.
        spacing: Of its points [m].
    """
    if not len(controllers):
        return np.zeros((0, 3))
    tree = cKDTree(points)
    near = controllers[tree.query(controllers)[0] < NEAR * spacing]
    if not len(near):
        return np.zeros((0, 3))
    if shape == "sheet":
        near = _onto_surface(near, points)
    elif shape == "solid":
        near = _inside(near, points)
    new = near[tree.query(near)[0] > FREE * spacing]
    return np.zeros((0, 3)) if not len(new) else new[farthest_points(new, FREE * spacing)]


def _onto_surface(places: Float64[Array, "n 3"], points: Float64[Array, "P 3"]) -> Float64[Array, "n 3"]:
    """Each on the plane of the points around it."""
    near = points[cKDTree(points).query(places, k=min(AROUND, len(points)))[1]]
    middle = near.mean(1)
    normal = np.linalg.svd(near - middle[:, None], full_matrices=False)[2][:, -1]
    out = ((places - middle) * normal).sum(1, keepdims=True)
    moved: Float64[Array, "n 3"] = places - out * normal
    return moved


def _inside(places: Float64[Array, "n 3"], points: Float64[Array, "P 3"]) -> Float64[Array, "n 3"]:
    """Those outside of the hull of the points are brought to it, one side of the hull after the other."""
    try:
        sides = ConvexHull(points).equations
    except QhullError:
        return places
    moved: Float64[Array, "n 3"] = places.copy()
    for _ in range(3):  # at an edge, leaving one side may lead out of another
        out = moved @ sides[:, :3].T + sides[:, 3]
        worst = out.argmax(1)
        moved -= np.maximum(out.max(1), 0.0)[:, None] * sides[worst, :3]
    return moved
