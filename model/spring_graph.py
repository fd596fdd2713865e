"""Which points are joined by springs: through the body, one piece, few across the borders of parts."""

import numpy as np
from jaxtyping import Bool, Float, Float64, Int, Int32
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.types import Array, Gaussians

BORDER = 3
"""Springs a point may have into other parts, from its own side."""
BRIDGES = 3
"""Springs that join a loose piece to the rest."""
_ALONG = tuple(np.linspace(0.125, 0.875, 7))
"""Where along a spring it is checked to run inside the body."""
_CANDIDATES = 64


def local_spacing(points: Float64[Array, "N 3"]) -> Float64[Array, " N"]:
    """Mean distance of each point to its nearest six [m]."""
    count = min(7, len(points))
    return np.asarray(cKDTree(points).query(points, count)[0][:, 1:].mean(axis=1), np.float64)


def join_points(
    points: Float64[Array, "N 3"],
    part: Int[Array, " N"],
    neighbours: Int[Array, " N"],
    reach: Float[Array, " N"],
    gaussians: Gaussians,
) -> tuple[Int32[Array, "E 2"], int]:
    """Springs between near points.

    Each point asks for its nearest `neighbours` within `reach`, of which only `BORDER` may belong to
    other parts; a spring is there when either end asks for it and it runs inside the body.

    Args:
        points: Rest positions [m].
        part: Label per point.
        neighbours: How many springs each point asks for.
        reach: How long they may be [m].
        gaussians: What the body occupies.

    Returns:
        Pairs i < j, sorted and unique; and how many loose pieces had to be bridged.
    """
    candidates = min(_CANDIDATES, len(points))
    distance, index = cKDTree(points).query(points, candidates)
    first = np.repeat(np.arange(len(points))[:, None], candidates, axis=1)
    usable = (distance > 0) & (distance <= reach[:, None])
    usable[usable] = _inside(points[first[usable]], points[index[usable]], gaussians)
    across = usable & (part[index] != part[:, None])
    usable &= ~across | (np.cumsum(across, axis=1) <= BORDER)
    usable &= np.cumsum(usable, axis=1) <= neighbours[:, None]
    springs = _unique(np.stack([first[usable], index[usable]], axis=1))
    return _bridge(points, springs)


def _inside(
    start: Float64[Array, "m 3"], end: Float64[Array, "m 3"], gaussians: Gaussians
) -> Bool[Array, " m"]:
    """Whether Gaussians lie all along the way."""
    tree = cKDTree(gaussians.means)
    own = tree.query(gaussians.means, min(4, len(gaussians)))[0][:, 1:].mean(axis=1)
    # half a cell's diagonal of a regular filling is 1.4 radii of the ball of the same volume
    ball = np.cbrt(3.0 * gaussians.volumes / (4.0 * np.pi))
    # and flat Gaussians reach as far as their neighbours are
    claim = np.maximum(1.5 * ball, 0.9 * own)
    filled = np.ones(len(start), bool)
    for share in _ALONG:
        middle = (1.0 - share) * start + share * end
        distance, index = tree.query(middle, min(4, len(gaussians)))
        near = distance.reshape(len(start), -1) <= claim[index].reshape(len(start), -1)
        filled &= near.any(axis=1)
    return filled


def _unique(pairs: Int[Array, "m 2"]) -> Int[Array, "E 2"]:
    ordered = np.sort(pairs, axis=1)
    return np.unique(ordered[ordered[:, 0] != ordered[:, 1]], axis=0).reshape(-1, 2)


def _bridge(points: Float64[Array, "N 3"], springs: Int[Array, "m 2"]) -> tuple[Int32[Array, "E 2"], int]:
    """Join loose pieces to the largest by their shortest links, nearest piece first."""
    bridged = 0
    while True:
        ones = np.ones(len(springs))
        graph = coo_matrix((ones, (springs[:, 0], springs[:, 1])), shape=(len(points),) * 2)
        pieces, label = connected_components(graph, directed=False)
        if pieces == 1:
            return springs.astype(np.int32), bridged
        main = label == np.argmax(np.bincount(label))
        inner, outer = np.flatnonzero(main), np.flatnonzero(~main)
        distance, index = cKDTree(points[inner]).query(points[outer])
        loose = label[outer] == label[outer[np.argmin(distance)]]
        shortest = np.flatnonzero(loose)[np.argsort(distance[loose], kind="stable")[:BRIDGES]]
        links = np.stack([outer[shortest], inner[index[shortest]]], axis=1)
        springs = _unique(np.concatenate([springs, links]))
        bridged += 1
