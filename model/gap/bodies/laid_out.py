"""Points laid out by how far apart those that are joined are: by the ways between all, then eased."""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import minimize
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from model.types import Array

STEPS = 1000
"""At most, to ease what was laid out by ways."""
SHORTEST = 1e-12
"""Length [m] below which a pair has no direction."""


def joined(near: Int64[Array, "N k"]) -> Int64[Array, "2 E"]:
    """Pairs of each point and those that it is near to, each once.

    Args:
        near: For each point.
    """
    pairs = np.stack([np.repeat(np.arange(len(near)), near.shape[1]), near.ravel()], axis=1)
    once: Int64[Array, "2 E"] = np.unique(np.sort(pairs, axis=1), axis=0).T
    return once


def by_ways(
    count: int, pairs: Int64[Array, "2 E"], apart: Float64[Array, " E"], axes: int
) -> Float64[Array, "N d"] | None:
    """Places as far apart as the shortest ways between them are long, as nearly as can be [m].

    None where they are in two pieces.

    Args:
        count: Of the points.
        pairs: That are joined, each once.
        apart: How far these are apart [m].
        axes: In so many directions.

    Reference:
        Tenenbaum, de Silva and Langford (2000), A global geometric framework for nonlinear dimensionality
        reduction, Science 290 (Isomap).
    """
    steps = coo_matrix((apart, (pairs[0], pairs[1])), (count, count))
    ways = dijkstra(steps.tocsr(), directed=False)
    if not np.isfinite(ways).all():
        return None
    square = ways**2
    inner = -0.5 * (square - square.mean(0) - square.mean(1)[:, None] + square.mean())
    values, vectors = np.linalg.eigh(inner)
    last = slice(None, -axes - 1, -1)
    places: Float64[Array, "N d"] = vectors[:, last] * np.sqrt(values[last].clip(0))
    return places


def eased(
    places: Float64[Array, "N d"],
    pairs: Int64[Array, "2 E"],
    apart: Float64[Array, " E"],
    *,
    weight: Float64[Array, " E"] | float = 1.0,
    only_nearer: Bool[Array, " E"] | bool = False,
    until: float,
) -> Float64[Array, "N d"]:
    """The least strained, from where ways that zigzag between points have put them [m].

    Args:
        places: To begin from [m].
        pairs: That should be as far apart as is said.
        apart: How far [m].
        weight: What each pair counts.
        only_nearer: Pairs that may be farther apart than that.
        until: A step gains less than this share.
    """

    def strain(at: Float64[Array, " n"]) -> tuple[float, Float64[Array, " n"]]:
        """Sum of its squares, and the slope of that."""
        now = at.reshape(places.shape)
        way = now[pairs[1]] - now[pairs[0]]
        length = np.maximum(np.linalg.norm(way, axis=1), SHORTEST)
        stretch = length / apart - 1.0
        stretch = np.where(only_nearer, np.minimum(stretch, 0.0), stretch)
        pull = (2.0 * weight * stretch / (apart * length))[:, None] * way
        slope = np.zeros_like(now)
        np.add.at(slope, pairs[1], pull)
        np.add.at(slope, pairs[0], -pull)
        return float((weight * stretch**2).sum()), slope.ravel()

    options = {"maxiter": STEPS, "ftol": until}
    found = minimize(strain, places.ravel(), jac=True, method="L-BFGS-B", options=options)
    least: Float64[Array, "N d"] = found.x.reshape(places.shape)
    return least
