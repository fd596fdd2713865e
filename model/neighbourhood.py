"""Which points of a volume touch: a connected k-nearest-neighbour graph."""

import numpy as np
from jaxtyping import Float, Float64, Int
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.types import Array

NEIGHBOUR_COUNT = 10
REACH = 2.5
"""Edges longer than this many local spacings jump a gap (arm to body) and are left out."""


def neighbourhood_graph(points: Float[Array, "N 3"]) -> csr_matrix:
    """Symmetric graph of touching points, edges weighted by their length [m], always connected.

    Each point is joined to its ten nearest neighbours within reach of the local spacing; pieces that stay
    apart are then joined where they come closest.

    Args:
        points: Positions [m], at least one.
    """
    points = np.asarray(points, np.float64)
    count = len(points)
    neighbours = min(NEIGHBOUR_COUNT, count - 1)
    if neighbours == 0:
        return csr_matrix((count, count))
    distance, index = cKDTree(points).query(points, k=neighbours + 1)
    spacing = distance[:, min(2, neighbours)]  # even a string has two neighbours that touch
    source = np.repeat(np.arange(count), neighbours)
    target, length = index[:, 1:].ravel(), distance[:, 1:].ravel()
    near = length <= REACH * np.minimum(spacing[source], spacing[target]) + 1e-12
    return _join_pieces(points, _symmetric(source[near], target[near], length[near], count))


def _symmetric(
    source: Int[Array, " E"], target: Int[Array, " E"], length: Float64[Array, " E"], count: int
) -> csr_matrix:
    # A zero would vanish from a sparse matrix, and with it the edge between coincident points.
    graph = coo_matrix((np.maximum(length, 1e-12), (source, target)), shape=(count, count)).tocsr()
    return graph.maximum(graph.T).tocsr()


def _join_pieces(points: Float64[Array, "N 3"], graph: csr_matrix) -> csr_matrix:
    """Add the shortest link from each piece to the rest, until there is one piece (Borůvka's way)."""
    while True:
        pieces, label = connected_components(graph, directed=False)
        if pieces == 1:
            return graph
        source, target, length = [], [], []
        for piece in range(pieces):
            inside, outside = np.flatnonzero(label == piece), np.flatnonzero(label != piece)
            distance, nearest = cKDTree(points[outside]).query(points[inside])
            best = int(np.argmin(distance))
            source.append(inside[best])
            target.append(outside[nearest[best]])
            length.append(distance[best])
        links = _symmetric(np.array(source), np.array(target), np.array(length), len(points))
        graph = graph.maximum(links).tocsr()
