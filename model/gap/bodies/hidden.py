"""What a hand hides of an object: the points that it holds, where nothing was seen of them."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import ConvexHull, QhullError, cKDTree
from scipy.spatial.distance import cdist

from model.gap.bodies.guess import Shape
from model.gap.bodies.leading import leads
from model.gap.bodies.neighbours import farthest_points, patch_normals
from model.types import Array, Observation

NEAR, FAR = 2.0, 6.0
"""Spacings: a hand that is farther away from all that was seen holds nothing; one that the object is seen to
follow may be even farther away."""
FREE = 0.7
"""Spacings: a place this far from all points is not yet filled."""
AROUND = 8
"""Points that a surface is told by."""


def hiding(
    points: Float64[Array, "P 3"], seen: Float64[Array, "N 3"], observation: Observation, spacing: float
) -> Bool[Array, " C"]:
    """Which controllers of the first frame hide something of the object: those near it, or that lead it.

    Args:
        points: Of the object, made from what was seen [m].
        seen: Where the observed points are in the first frame [m]; NaN for those that are never seen.
        observation: What they did, and what the controllers did.
        spacing: Of its points [m].
    """
    controllers = observation.controllers.astype(np.float64)
    if not controllers.shape[1]:
        return np.zeros(0, bool)
    gaps = cKDTree(points).query(controllers[0])[0]
    hides: Bool[Array, " C"] = gaps < NEAR * spacing
    # of a hand that is near in part the rest is the hand's own
    alone = cdist(controllers[0], controllers[0, hides]).min(1, initial=np.inf) > FAR * spacing
    for i in np.flatnonzero(alone & (gaps < FAR * spacing)):
        around = np.linalg.norm(seen - controllers[0, i], axis=1) <= gaps[i] + spacing
        hides[i] = leads(controllers[:, i], observation.points[:, around], float(gaps[i]))
    return hides


def hidden_points(
    points: Float64[Array, "P 3"], controllers: Float64[Array, "C 3"], shape: Shape, spacing: float
) -> Float64[Array, "h 3"]:
    """Points of the object under the hand: where controllers are, brought onto the sheet or into the solid.

    Controllers are on the hand, which is thicker than what it holds: points in their own places would stand
    out of a sheet, hang below the ground and turn with nothing but the hand. What is between the hand and
    what is seen is filled as well.

    Args:
        points: Of the object, made from what was seen [m].
        controllers: In the first frame, those that hide something [m].
        shape: Of the object, a sheet or a solid: a rope goes on to its hand by itself.
        spacing: Of its points [m].
    """
    if not len(controllers):
        return np.zeros((0, 3))
    tree = cKDTree(points)
    gaps, beside = tree.query(controllers, k=min(AROUND, len(points)))
    under = (_onto_surface if shape == "sheet" else _inside)(controllers, points)
    far = np.flatnonzero(gaps[:, 0] >= NEAR * spacing)
    under = np.concatenate([under, *(_between(under[i], points[beside[i]], spacing) for i in far)])
    new = under[tree.query(under)[0] > FREE * spacing]
    return np.zeros((0, 3)) if not len(new) else new[farthest_points(new, FREE * spacing)]


def _between(
    place: Float64[Array, "3"], points: Float64[Array, "k 3"], spacing: float
) -> Float64[Array, "n 3"]:
    """Places in the triangles between one and any two of some points, no farther apart than these are."""
    farthest = float(np.linalg.norm(points - place, axis=1).max())
    marks = np.linspace(0.0, 1.0, 1 + int(np.ceil(farthest / spacing)))[:-1]
    one, other = (each.ravel() for each in np.meshgrid(marks, marks))
    inside = (one + other > 0.0) & (one + other < 1.0)
    first, second = (points[side] - place for side in np.triu_indices(len(points), 1))
    filled: Float64[Array, "m t 3"] = (
        place + one[inside, None, None] * first + other[inside, None, None] * second
    )
    return filled.reshape(-1, 3)


def _onto_surface(places: Float64[Array, "n 3"], points: Float64[Array, "P 3"]) -> Float64[Array, "n 3"]:
    """Each on the plane of the points around it."""
    near = points[cKDTree(points).query(places, k=min(AROUND, len(points)))[1]]
    normal = patch_normals(near)
    out = ((places - near.mean(1)) * normal).sum(1, keepdims=True)
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
