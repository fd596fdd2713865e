"""How far along an object its points are."""

import numpy as np
from jaxtyping import Float64
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from model.types import Array

BESIDE, ONE_IN, FEW = 8, 6, 20
"""Neighbours to which a way may lead straight, no more than one point in so many, of few none: all others are
neighbours then, and the way would lead across bends."""


def along(places: Float64[Array, "N 3"]) -> tuple[Float64[Array, " N"], float]:
    """Distance [m] of each point from one end, through its neighbours, and the largest."""
    count = len(places)
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    near = np.argsort(apart, axis=1)[:, 1 : 1 + (0 if count < FEW else min(BESIDE, count // ONE_IN))]
    graph = np.zeros((count, count))
    rows = np.repeat(np.arange(count), near.shape[1])
    graph[rows, near.ravel()] = apart[rows, near.ravel()]
    graph = np.maximum(graph, graph.T)
    graph = np.maximum(graph, spanning_tree(places))
    farthest = int(np.linalg.norm(places - places.mean(0), axis=1).argmax())  # whatever the points' order
    end = int(dijkstra(graph, indices=farthest).argmax())
    away = dijkstra(graph, indices=end)
    return away, float(away.max())


def spanning_tree(places: Float64[Array, "N 3"]) -> Float64[Array, "N N"]:
    """Lengths [m] of what joins all points with the least length in sum, both ways; 0 where nothing does."""
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    tree = minimum_spanning_tree(apart + 1e-12).toarray()
    both: Float64[Array, "N N"] = np.maximum(tree, tree.T)
    return both
