"""The order of the points of a spring graph in memory, and the end at which each spring is computed."""

import numpy as np
from jaxtyping import Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

ROUNDS = 24
"""Of evening out at which ends springs are computed."""
STRETCH = 64
"""Points that may change places, so that those which lie together own equally many springs."""


def near(pairs: Int[np.ndarray, "2 e"], count: int) -> Int[np.ndarray, " N"]:
    """Points in an order in which those that springs join are near each other.

    Reference:
        Cuthill and McKee (1969), Reducing the bandwidth of sparse symmetric matrices, Proc. 24th National
        Conference of the ACM.
    """
    joined = coo_matrix((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(count, count))
    order = reverse_cuthill_mckee((joined + joined.T).tocsr(), symmetric_mode=True)
    return np.asarray(order, np.int64)


def owners(pairs: Int[np.ndarray, "2 e"], count: int) -> Int[np.ndarray, " e"]:
    """One end of each spring, 0 or 1, such that neighbours own about equally many springs.

    From a random choice, springs go over to the other end where that owns fewer.
    """
    rng = np.random.default_rng(0)
    ends = np.arange(pairs.shape[1])
    owner = rng.integers(0, 2, len(ends))
    for _ in range(ROUNDS):
        mine, other = pairs[owner, ends], pairs[1 - owner, ends]
        owned = np.bincount(mine, minlength=count)
        surplus = owned[mine] - owned[other]
        passed = (surplus > 1) & (rng.random(len(ends)) < surplus / (2.0 * owned[mine]))
        owner = np.where(passed, 1 - owner, owner)
    return owner


def levelled(order: Int[np.ndarray, " N"], owned: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """An order of points, sorted within each `STRETCH` by how many springs each point owns.

    Points are computed in slices, and a slice takes as long as the one in it that owns most.

    Reference:
        Kreutzer et al. (2014), A unified sparse matrix data format for efficient general sparse matrix-vector
        multiplication on modern processors with wide SIMD units, SIAM J. Sci. Comput. 36 (SELL-C-sigma).
    """
    return order[np.lexsort((owned[order], np.arange(len(order)) // STRETCH))]
