"""The tensions with which a body is at rest under its weight."""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import lsqr

from model.types import Array

RELUCTANCE = 0.02
"""How strongly small tensions are preferred, against an exact balance."""


def resting_tensions(
    points: Float64[Array, "P 3"],
    springs: Int64[Array, "E 2"],
    weights: Float64[Array, "P 3"],
    borne: Bool[Array, " P"],
) -> Float64[Array, " E"]:
    """Tension of each spring [N] with which every point that nothing else bears is in balance.

    A least-squares solution, the smallest of those that balance: a body is seldom at ease in the shape in
    which it is first seen. It depends on the shape and the weight alone, not on any stiffness: a spring of
    stiffness k and length d then has the rest length d − tension / k.

    Args:
        points: Where the body is at rest [m].
        springs: Pairs of points.
        weights: External force on each point [N].
        borne: Points that a hand or the ground bears; their balance is not asked for.
    """
    if not len(springs):
        return np.zeros(0)
    way = points[springs[:, 1]] - points[springs[:, 0]]
    axis = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    edge = np.arange(len(springs))
    rows = np.concatenate([3 * springs[:, end, None] + np.arange(3) for end in (0, 1)]).ravel()
    columns = np.tile(np.repeat(edge, 3), 2)
    entries = np.concatenate([axis, -axis]).ravel()
    asked = np.repeat(~borne, 3)
    balance = coo_matrix((entries * asked[rows], (rows, columns)), shape=(3 * len(points), len(springs)))
    load = -(weights.ravel() * asked)
    tensions: Float64[Array, " E"] = lsqr(balance.tocsr(), load, damp=RELUCTANCE, iter_lim=400)[0]
    return tensions
