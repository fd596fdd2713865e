"""Points carried by the nodes of a mesh, exactly for every affine motion."""

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.reality.world import Array


def attach(points: Array, nodes: Array, count: int = 8) -> tuple[Array, Array]:
    """Nearest nodes and weights of each point: index [N, k], weight [N, k].

    Weights are a moving least-squares fit of an affine function, so they sum to one and reproduce positions
    as far as the nodes span the space around them.
    """
    count = min(count, len(nodes))
    distance, index = cKDTree(nodes).query(points, k=np.arange(1, count + 1))
    width = distance[:, -1:] * 0.6 + 1e-9
    near = np.exp(-((distance / width) ** 2)) + 1e-6
    weights = np.empty_like(distance)
    for row, (point, chosen, closeness) in enumerate(zip(points, index, near, strict=True)):
        basis = np.column_stack([np.ones(count), (nodes[chosen] - point) / width[row]])
        scaled = basis * closeness[:, None]
        normal = scaled.T @ basis
        # Directions that the nodes do not span (the normal of a sheet) must not be amplified.
        solution = np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ np.array([1.0, 0, 0, 0])
        weights[row] = scaled @ solution
    weights /= weights.sum(axis=1, keepdims=True)
    return index, weights


def carry(nodes: Array, index: Array, weights: Array) -> Array:
    """Positions [T, N, 3] of the points when the nodes are at [T, n, 3]."""
    return np.einsum("nk,tnkc->tnc", weights, nodes[:, index])
