"""What the tension of a cloth can hold up, and whether what is seen of an object needs more than that.

A cloth at rest hangs from hands, or from what of it lies on the ground: its threads pull, and never push. The
flat top of a block that one camera sees reaches far from the hand and does not sag: something pushes below.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import linprog
from scipy.sparse import coo_matrix, hstack, identity
from scipy.spatial import Delaunay, QhullError, cKDTree

from model.gap.bodies.falling import falls
from model.gap.bodies.neighbours import FOURTH, usual_distance
from model.gap.bodies.unheld import off_the_ground, unheld
from model.types import Array, Observation

STANDS = 0.7
"""Share of the loose weight that tension cannot hold up, from which something stands. Of what cameras see of
solids it is 0.85 to 1, of cloths at rest at most 0.28, with a wind in it 0.24."""
FEW = 0.1
"""Share of the points below which too little is loose to tell anything."""
THREADS, LONGEST = 8, 2.5
"""Neighbours that a point may hang from, and how far they are at most, in usual distances."""
SIDEWAYS = 0.5
"""What a push sideways that is missing counts, over one upward: folds, and a little stiffness, give some."""


def stands(observation: Observation, places: Float64[Array, "N 3"]) -> bool:
    """Whether most of what neither lies on the ground nor is held would fall, were it a cloth.

    A mat that is held in the air may be stiff enough to reach out; and between hands, of what is nearly
    flat, noise hides how it sags. Neither is asked.

    Args:
        observation: Whose ground and hands count.
        places: Points on the object in the first frame, at rest [m].
    """
    ground, down = observation.ground_height, np.asarray(observation.gravity, np.float64)
    if ground is None or len(places) <= THREADS or not down.any() or falls(observation):
        return False
    far, raised = unheld(observation, places), off_the_ground(places, ground)
    if raised.all() and not far.all():
        return False
    loose = far & raised & ~_between_hands(observation, places)
    return bool(loose.mean() > FEW and unsupported(places, loose, down) > STANDS)


def unsupported(places: Float64[Array, "N 3"], loose: Bool[Array, " N"], down: Float64[Array, "3"]) -> float:
    """Share of the weight of what is loose that threads between neighbours cannot hold up, however taut.

    What is missing to balance weight and pulls is least, by linear programming.

    Args:
        places: Points that weigh alike [m].
        loose: Which of them nothing else bears; at least one.
        down: Along gravity, of any length.

    Reference:
        Heyman (1966), The stone skeleton, International journal of solids and structures 2 (what stands is
        what forces of one sign can balance; there all push, here all pull).
    """
    threads, row, count = _threads(places, loose), np.cumsum(loose) - 1, int(loose.sum())
    way = places[threads[:, 1]] - places[threads[:, 0]]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    up = -down / np.linalg.norm(down)
    # upward and two ways sideways
    axes = np.linalg.svd(up[None])[2]
    axes[0] = up
    entries = []
    for sign, end in ((1.0, 0), (-1.0, 1)):
        own = np.flatnonzero(loose[threads[:, end]])
        for axis, toward in enumerate(axes):
            entries.append((3 * row[threads[own, end]] + axis, own, sign * way[own] @ toward))
    rows, columns, values = (np.concatenate(each) for each in zip(*entries, strict=True))
    pulls = coo_matrix((values, (rows, columns)), shape=(3 * count, len(threads)))
    missing = identity(3 * count)
    price = np.tile([1.0, SIDEWAYS, SIDEWAYS], count)
    found = linprog(
        np.concatenate([np.zeros(len(threads)), price, price]),
        A_eq=hstack([pulls, missing, -missing]).tocsr(),
        b_eq=np.tile([1.0, 0.0, 0.0], count),
        method="highs",
    )
    return float(found.fun) / count


def _threads(places: Float64[Array, "N 3"], loose: Bool[Array, " N"]) -> Int64[Array, "E 2"]:
    """Pairs of neighbours, of which one is loose."""
    distance, near = cKDTree(places).query(places, k=THREADS + 1)
    close = distance <= LONGEST * usual_distance(places, FOURTH)
    first = np.repeat(np.arange(len(places)), THREADS + 1).reshape(near.shape)
    pairs = np.sort(np.stack([first[close], near[close]], 1), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
    some: Int64[Array, "E 2"] = pairs[loose[pairs].any(1)].astype(np.int64)
    return some


def _between_hands(observation: Observation, places: Float64[Array, "N 3"]) -> Bool[Array, " N"]:
    """Which are, seen from above, within the outline of all hands."""
    hands = observation.controllers[0, :, :2].astype(np.float64)
    try:
        within: Bool[Array, " N"] = Delaunay(hands).find_simplex(places[:, :2]) >= 0
    except (QhullError, ValueError):  # too few, or in a row: nothing is between them
        return np.zeros(len(places), bool)
    return within
