"""Ways through the inside of a body."""

import numpy as np
from jaxtyping import Float, Float64
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from model.types import Array, Gaussians

_NODES = 3000
_NEIGHBOURS = 20


def ways_through(
    gaussians: Gaussians, sources: Float[Array, "m 3"], targets: Float[Array, "n 3"]
) -> Float64[Array, "m n"]:
    """Shortest ways [m] from sources to targets along the body's Gaussians.

    Gaussians are joined to their nearest neighbours, so ways bend around gaps; they are a few percent
    too long because they zigzag. Between pieces that do not hang together the straight distance counts.

    Reference:
        Tenenbaum, de Silva and Langford (2000), A global geometric framework for nonlinear
        dimensionality reduction (geodesics on neighbour graphs).
    """
    means = gaussians.means.astype(np.float64)
    nodes = means[:: max(1, -(-len(means) // _NODES))]
    neighbours = min(_NEIGHBOURS + 1, len(nodes))
    distance, index = cKDTree(nodes).query(nodes, neighbours)
    distance, index = distance.reshape(len(nodes), -1), index.reshape(len(nodes), -1)
    rows = np.repeat(np.arange(len(nodes)), neighbours)
    graph = csr_matrix((np.maximum(distance.ravel(), 1e-12), (rows, index.ravel())), shape=(len(nodes),) * 2)
    tree = cKDTree(nodes)
    from_distance, from_node = tree.query(sources)
    to_distance, to_node = tree.query(targets)
    inner = np.atleast_2d(dijkstra(graph, directed=False, indices=from_node))
    way = inner[:, to_node] + from_distance[:, None] + to_distance[None]
    straight = np.linalg.norm(sources[:, None] - targets[None], axis=2)
    return np.asarray(np.where(np.isfinite(way), np.maximum(way, straight), straight), np.float64)
