"""The rule by which PhysTwin joins points, sought backwards: which radius and count give these springs?"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int, Int64
from scipy.spatial import cKDTree

from model.errors import InputError
from model.types import Array

TIE = 1e-9
"""Relative difference below which the order of two distances is chance."""
MARGIN = 0.02
"""How far beyond the longest spring the next distance is looked for, as a share of it."""
SHORTEST = 1e-4
"""Springs shorter than this are not made there [m]."""
MOST = 20
"""Springs that the rule may make for each that is wanted: they cost time there, even if they do nothing."""
SPARE = -1
"""In the order of a rule: a spring that nobody wants."""


@dataclass(frozen=True)
class Rule:
    """Every point joins its nearest neighbours, `neighbours` of them at most, within `radius`."""

    radius: float
    """[m]."""
    neighbours: int
    """As its search counts: of a point of the object, the point itself included."""
    order: Int64[Array, " S"]
    """Which of the given springs is first, second, … by the rule, or `SPARE`."""


def spring_rule(
    points: Float32[Array, "N 3"],
    springs: Int[Array, "E 2"],
    centers: Float32[Array, "C 3"] | None = None,
) -> Rule:
    """The rule that gives these springs, and as few others as can be.

    Args:
        points: Rest places as the files have them [m].
        springs: Pairs of points; with `centers`, pairs (center, point).
        centers: What joins points, where it is not the points themselves [m].

    Raises:
        InputError: no radius and count give these springs without `MOST` times as many others, or they depend
            on distances that are equal.

    Reference:
        Jiang et al. (2025), PhysTwin, and its code (qqtt/engine/trainer_warp.py, `_init_start`).
    """
    what = "springs" if centers is None else "controller springs"
    if not len(springs):
        raise InputError(f"phystwin: there are no {what}")
    single = points.astype(np.float64)
    origin = single if centers is None else centers.astype(np.float64)
    longest = float(np.linalg.norm(origin[springs[:, 0]] - single[springs[:, 1]], axis=1).max())
    radius = _radius(single, origin, longest)
    rows = [np.array(row, np.int64) for row in cKDTree(single).query_ball_point(origin, radius)]
    distances = [np.linalg.norm(single[row] - place, axis=1) for row, place in zip(rows, origin, strict=True)]
    ranked = [np.argsort(away, kind="stable") for away in distances]
    rows = [row[rank] for row, rank in zip(rows, ranked, strict=True)]
    distances = [away[rank] for away, rank in zip(distances, ranked, strict=True)]
    wanted = {_key(pair, centers is None): number for number, pair in enumerate(springs.tolist())}
    low, high = 1, max(len(row) for row in rows)
    while low < high:
        middle = (low + high) // 2
        enough = wanted.keys() <= set(_join(rows, distances, middle, centers is None))
        low, high = (low, middle) if enough else (middle + 1, high)
    made = _join(rows, distances, low, centers is None)
    if not wanted.keys() <= set(made) or len(made) > MOST * len(wanted):
        raise InputError(
            f"phystwin: no radius and number of neighbours give the {what} of this twin: its playground "
            f"joins the nearest points within {longest:.3g} m, which would be {len(made)} or so, and the "
            f"twin has {len(wanted)}"
        )
    _refuse_ties(distances, low, what)
    return Rule(radius, low, np.array([wanted.get(pair, SPARE) for pair in made], np.int64))


def _radius(points: Float64[Array, "N 3"], origin: Float64[Array, "C 3"], longest: float) -> float:
    """Halfway between the longest spring and the next distance, so that rounding changes nothing [m]."""
    tree, reach = cKDTree(points), (1 + MARGIN) * longest
    near = tree.sparse_distance_matrix(cKDTree(origin), reach, output_type="ndarray")["v"]
    longer = near[near > longest * (1 + TIE)]
    return 0.5 * (longest + float(longer.min(initial=reach)))


def _join(rows: list[Array], distances: list[Array], count: int, own: bool) -> list[tuple[int, int]]:
    """The springs by the rule, in its order."""
    made: dict[tuple[int, int], None] = {}
    for i, (row, away) in enumerate(zip(rows, distances, strict=True)):
        near = row[:count][1:] if own else row[:count]
        far = away[:count][1:] if own else away[:count]
        for j in near[far > SHORTEST].tolist() if own else near.tolist():
            made.setdefault(_key((i, j), own))
    return list(made)


def _key(pair: "tuple[int, int] | list[int]", own: bool) -> tuple[int, int]:
    first, second = pair
    return (min(first, second), max(first, second)) if own else (first, second)


def _refuse_ties(distances: list[Array], count: int, what: str) -> None:
    """Its order, and who is the last of the neighbours, would be chance among equal distances."""
    for away in distances:
        kept = away[: count + 1]
        if (np.diff(kept) <= TIE * kept[1:]).any():
            raise InputError(
                f"phystwin: some {what} are equally long, and its playground would take them in any order"
            )
