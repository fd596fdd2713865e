"""How far along an object its points are."""

import numpy as np
from jaxtyping import Float64
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from model.types import Array


def along(places: Float64[Array, "N 3"]) -> tuple[Float64[Array, " N"], float]:
    """Distance [m] of each point from one end, through its neighbours, and the largest."""
    count = len(places)
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    near = np.argsort(apart, axis=1)[:, 1 : min(9, count)]
    graph = np.zeros((count, count))
    rows = np.repeat(np.arange(count), near.shape[1])
    graph[rows, near.ravel()] = apart[rows, near.ravel()]
    graph = np.maximum(graph, graph.T)
    tree = minimum_spanning_tree(apart + 1e-12).toarray()
    graph = np.maximum(graph, np.maximum(tree, tree.T))
    farthest = int(np.linalg.norm(places - places.mean(0), axis=1).argmax())  # whatever the points' order
    end = int(dijkstra(graph, indices=farthest).argmax())
    away = dijkstra(graph, indices=end)
    return away, float(away.max())
