"""How fast the fastest mode of a spring network at rest is."""

import numpy as np
from jaxtyping import Float, Float64
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import eigsh

from model.types import Array, Topology

_EXACT_BELOW = 30
"""Matrices so small are solved densely."""


def fastest(topology: Topology, strength: Float[Array, " E"], grip_strength: Float[Array, " S"]) -> float:
    r"""Largest eigenvalue of $M^{-1}\sum_e s_e n_e n_e^T$ over springs and controller springs at rest.

    With stiffness [N/m] as strength it is ω² of the fastest mode [1/s²], with dashpots [N·s/m] its decay
    rate [1/s].
    """
    network = _rows(topology)
    weighted = network.T @ diags(np.concatenate([strength, grip_strength]).astype(np.float64)) @ network
    root = diags(np.repeat(1.0 / np.sqrt(topology.mass.astype(np.float64)), 3))
    matrix = (root @ weighted @ root).tocsr()
    if matrix.shape[0] < _EXACT_BELOW:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    start = np.random.default_rng(0).standard_normal(matrix.shape[0])
    largest = eigsh(matrix, k=1, which="LA", v0=start, tol=1e-3, return_eigenvectors=False)
    return float(largest[0])


def stable_step(frequency_squared: float, decay: float) -> float:
    """Largest stable step [s] of semi-implicit Euler: dt²·ω² + 2·dt·decay = 4."""
    return 4.0 / (decay + float(np.sqrt(decay**2 + 4.0 * frequency_squared)))


def _rows(topology: Topology) -> csr_matrix:
    """One row per spring: its direction at one end, the opposite at the other [E + S, 3N]."""
    points = topology.points.astype(np.float64)
    first, second = topology.springs.astype(np.int64).T
    held, grips = topology.controller_springs.astype(np.int64).T
    inner = _directions(points[second] - points[first])
    outer = _directions(points[grips] - topology.controller_points.astype(np.float64)[held])
    values = np.concatenate([inner, -inner, outer])
    ends = np.concatenate([second, first, grips])
    count, grip_count = len(first), len(grips)
    rows = np.concatenate([np.arange(count), np.arange(count), count + np.arange(grip_count)])
    columns = 3 * ends[:, None] + np.arange(3)
    shape = (count + grip_count, 3 * len(points))
    return csr_matrix((values.ravel(), (np.repeat(rows, 3), columns.ravel())), shape=shape)


def _directions(offsets: Float64[Array, "m 3"]) -> Float64[Array, "m 3"]:
    length = np.linalg.norm(offsets, axis=1, keepdims=True)
    return np.asarray(offsets / np.maximum(length, 1e-12), np.float64)
