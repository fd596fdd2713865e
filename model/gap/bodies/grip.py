"""What a hand does to the points that it holds: they go with it as if they were part of it."""

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.gap.bodies.hand import LOUDEST
from model.types import Array

FLAT = 0.05
"""Controllers that spread less than this share of their length across it do not tell a turn."""
OTHERS = 4
"""Controllers that a held point goes with where the hand itself changes shape."""
TURNED = 4.0
"""Mean squares that noise leaves: of so many, or more, is a turn that is told."""


def held_places(
    controllers: Float[Array, "T C 3"], points: Float64[Array, "H 3"], apart: float
) -> Float64[Array, "T H 3"]:
    """Where a hand carries the points that it holds.

    Controllers that start near each other are a hand. A hand moves as a rigid body, by the turn and shift
    that fit its controllers best; what it does besides is taken on by nearness.

    Args:
        controllers: Where the controllers are [m].
        points: Held points in the first frame [m].
        apart: Controllers farther than this from all others of a hand belong to another [m].

    Returns:
        The places of the points in all frames, those of the first as given.

    Reference:
        Kabsch (1976), A solution for the best rotation to relate two sets of vectors, Acta
        Crystallographica A 32.
    """
    places = controllers.astype(np.float64)
    hands, nearest = holding(places[0], points, apart)
    carried = np.zeros((len(places), *points.shape))
    for hand in np.unique(nearest):
        own, mine = places[:, hands == hand], nearest == hand
        carried[:, mine] = _carried(own, points[mine])
    return carried


def holding(
    controllers: Float64[Array, "C 3"], points: Float64[Array, "H 3"], apart: float
) -> tuple[Int64[Array, " C"], Int64[Array, " H"]]:
    """The hand that each controller belongs to, and the one that holds each point: that of the nearest.

    Args:
        controllers: In the first frame [m].
        points: Held points in the first frame [m].
        apart: As of `held_places`.
    """
    hands = hands_of(controllers, apart)
    return hands, hands[cKDTree(controllers).query(points)[1]]


def idle_hands(
    controllers: Float64[Array, "C 3"], points: Float64[Array, "H 3"], apart: float
) -> list[Int64[Array, " c"]]:
    """The controllers of each hand that holds none of the held points: another is nearer to all of them.

    Args:
        controllers: In the first frame [m].
        points: Held points in the first frame [m].
        apart: As of `held_places`.
    """
    hands, busy = holding(controllers, points, apart)
    return [np.flatnonzero(hands == hand) for hand in np.setdiff1d(hands, busy)]


def hands_of(places: Float64[Array, "C 3"], apart: float) -> Int64[Array, " C"]:
    """Which hand each controller belongs to: those nearer than `apart` [m] to another of a hand are of it."""
    if len(places) < 2:
        return np.zeros(len(places), np.int64)
    labels: Int64[Array, " C"] = fcluster(linkage(places, "single"), apart, "distance").astype(np.int64)
    return labels


def _only_shifts(relative: Float64[Array, "T c 3"], turned: float) -> bool:
    """Whether controllers of one hand move against each other by no more than their noise.

    A few of them near each other tell badly how a hand turns: 2 mm of noise on four within a centimetre turn
    it by 30°, and what it holds in between is swung about. So a turn is to explain more of how they move than
    it would of noise.

    Args:
        relative: Its controllers about their middle [m], three or more that are not in a row.
        turned: Sum of the squares by which the best turns of the first frame miss them [m²].

    Reference:
        Fisher (1925), Statistical methods for research workers, section 41 (two mean squares, each by its
        degrees of freedom).
    """
    frames, count = len(relative) - 1, len(relative[0])
    shifted = float(((relative - relative[0]) ** 2).sum())
    if shifted > 2.0 * 3.0 * (count - 1) * frames * LOUDEST**2:
        return False
    return (shifted - turned) / 3.0 < TURNED * turned / (3.0 * count - 6.0)


def _carried(hand: Float64[Array, "T c 3"], points: Float64[Array, "h 3"]) -> Float64[Array, "T h 3"]:
    middle = hand.mean(1)
    relative = hand - middle[:, None]
    first = relative[0]
    spread = np.linalg.svd(first, compute_uv=False)
    turns = []
    if len(first) >= 3 and spread[1] > FLAT * spread[0] > 0:
        turns = [Rotation.align_vectors(now, first) for now in relative]
    if turns and _only_shifts(relative, float(sum(missed**2 for _, missed in turns))):
        shifted: Float64[Array, "T h 3"] = points + (middle - middle[0])[:, None]
        return shifted
    distance, near = cKDTree(hand[0]).query(points, k=min(OTHERS, len(first)))
    distance, near = distance.reshape(len(points), -1), near.reshape(len(points), -1)
    weight = 1.0 / (distance + 1e-9 + 0.1 * distance.max()) ** 2
    weight /= weight.sum(1, keepdims=True)
    carried = np.zeros((len(hand), *points.shape))
    for t, now in enumerate(relative):
        turn = turns[t][0] if turns else Rotation.identity()
        rest = now - turn.apply(first)
        carried[t] = middle[t] + turn.apply(points - middle[0]) + (weight[..., None] * rest[near]).sum(1)
    return carried
