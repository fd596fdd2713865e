"""Who is near whom: subsets that cover all, pairs within reach, what hangs together, usual distances."""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.types import Array

FOURTH = 4
"""Neighbour whose usual distance tells how far apart points are, evenly spread or by lot."""


def farthest_points(places: Float64[Array, "N 3"], apart: float) -> Int64[Array, " n"]:
    """Indices of points at least `apart` [m] from each other that cover all, whatever their order.

    The first is the one farthest from the middle.
    """
    chosen = [int(np.linalg.norm(places - places.mean(0), axis=1).argmax())]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while distance.max() > apart:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.array(sorted(chosen), np.int64)


def covering_points(places: Float64[Array, "N 3"], most: int) -> Int64[Array, " n"]:
    """Indices of so many points that cover all as well as they can: each the farthest from those before.

    Fewer where points are in fewer places: one of each. The first is the one farthest from the middle, so
    that the order of the points does not matter.
    """
    chosen: list[int] = []
    distance = np.linalg.norm(places - places.mean(0), axis=1)
    nearest = np.full(len(places), np.inf)
    while len(chosen) < min(most, len(places)):
        chosen.append(int(distance.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[chosen[-1]], axis=1))
        distance = nearest
        if not distance.any():
            break
    return np.array(sorted(chosen), np.int64)


def pairs_within(points: Float64[Array, "P 3"], reach: float, least: int) -> Int64[Array, "E 2"]:
    """Pairs within reach [m], and each point with its nearest `least`."""
    tree = cKDTree(points)
    pairs = {(int(a), int(b)) for a, b in tree.query_pairs(reach, output_type="ndarray")}
    near = tree.query(points, k=min(least + 1, len(points)))[1][:, 1:]
    pairs |= {(min(i, int(j)), max(i, int(j))) for i, row in enumerate(near) for j in row}
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)


def hanging_together(pairs: Int64[Array, "E 2"], count: int) -> Int64[Array, " P"]:
    """Which of the parts that pairs join each of so many points is of."""
    joined = coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    parts: Int64[Array, " P"] = connected_components(joined, directed=False)[1].astype(np.int64)
    return parts


def patch_normals(patches: Float64[Array, "N k 3"]) -> Float64[Array, "N 3"]:
    """Unit normal of the plane that is nearest to each patch of points, on either side."""
    own = patches - patches.mean(1, keepdims=True)
    normals: Float64[Array, "N 3"] = np.linalg.svd(own, full_matrices=False)[2][:, -1]
    return normals


def usual_distance(places: Float64[Array, "N 3"], neighbour: int = 1) -> float:
    """Median distance to the nearest neighbour [m], or to one farther away; the last if there are fewer."""
    count = min(neighbour + 1, len(places))
    return float(np.median(cKDTree(places).query(places, k=[count])[0]))
