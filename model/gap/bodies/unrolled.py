"""A bent sheet laid out flat: where each of its points would be if it were unrolled."""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import minimize
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from model.types import Array

AROUND = 10
"""Points that one is joined to, of which the way from any to any other is made."""
TRUE, NEARLY_ALL = (0.9, 1.1), 0.95
"""Laid out flat, so many neighbours are as far apart as they are but for these factors: of what hangs over a
ball a third as large, too; of what lies on itself they are not."""
STEPS = 1000
"""At most, to ease what was laid out by ways."""


def unrolled(places: Float64[Array, "N 3"]) -> Float64[Array, "N 2"] | None:
    """Where the points of a sheet are in it [m], its longer axis first; None where nothing lays it out.

    From its front, if that shows distances between neighbours as they are; else such that the ways in it
    are as long as they are (Isomap: J. B. Tenenbaum, V. de Silva, J. C. Langford, Science 290 (2000)), and
    from there neighbours as far apart as they are. What lies on itself, or hangs over what is thinner than
    points are apart, has its sides joined by mistake and is seldom laid out by either.

    Args:
        places: Points on it, more than `AROUND` [m].
    """
    front = _by_front(places)
    if _is_true(front, places):
        return front
    along = _by_ways(places)
    if along is None:
        return None
    along = _eased(along, places)
    return along if _is_true(along, places) else None


def _is_true(flat: Float64[Array, "N 2"], places: Float64[Array, "N 3"]) -> bool:
    """Whether neighbours, in space and laid out flat, are as far apart there as here."""
    return all(
        float(((ratio > TRUE[0]) & (ratio < TRUE[1])).mean()) >= NEARLY_ALL
        for ratio in (_ratio(flat, places, places), _ratio(flat, places, flat))
    )


def _ratio(
    flat: Float64[Array, "N 2"], places: Float64[Array, "N 3"], by: Float64[Array, "N d"]
) -> Float64[Array, "N k"]:
    """How many times as far apart the nearest (in `by`) are as they are."""
    near = _nearest(by)
    laid, real = (np.linalg.norm(at[near] - at[:, None], axis=-1) for at in (flat, places))
    ratio: Float64[Array, "N k"] = laid / np.maximum(real, 1e-9)
    return ratio


def _by_front(places: Float64[Array, "N d"]) -> Float64[Array, "N 2"]:
    """Along the two axes in which they reach farthest, the longer one first, their mean in the middle."""
    middle = places - places.mean(0)
    flat: Float64[Array, "N 2"] = middle @ np.linalg.eigh(middle.T @ middle)[1][:, :-3:-1]
    return flat


def _by_ways(places: Float64[Array, "N 3"]) -> Float64[Array, "N 2"] | None:
    """Laid out by the lengths of the shortest ways from neighbour to neighbour; None: it is in two pieces."""
    count, near = len(places), _nearest(places)
    apart = np.linalg.norm(places[near] - places[:, None], axis=-1)
    steps = csr_matrix((apart.ravel(), near.ravel(), AROUND * np.arange(count + 1)), (count, count))
    ways = dijkstra(steps, directed=False)
    if not np.isfinite(ways).all():
        return None
    square = ways**2
    inner = -0.5 * (square - square.mean(0) - square.mean(1)[:, None] + square.mean())
    values, axes = np.linalg.eigh(inner)
    flat: Float64[Array, "N 2"] = axes[:, :-3:-1] * np.sqrt(values[:-3:-1].clip(0))
    return flat


def _eased(flat: Float64[Array, "N 2"], places: Float64[Array, "N 3"]) -> Float64[Array, "N 2"]:
    """The least strained between neighbours, from where ways that zigzag between points have put them."""
    near = _nearest(places)
    pairs = np.sort(np.stack([np.repeat(np.arange(len(near)), near.shape[1]), near.ravel()], -1), axis=1)
    one, other = np.unique(pairs, axis=0).T
    apart = np.maximum(np.linalg.norm(places[other] - places[one], axis=1), 1e-9)

    def strain(at: Float64[Array, " n"]) -> tuple[float, Float64[Array, " n"]]:
        """Sum of its squares, and the slope of that."""
        way = at.reshape(-1, 2)[other] - at.reshape(-1, 2)[one]
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        stretch = length / apart - 1.0
        pull = (2.0 * stretch / (apart * length))[:, None] * way
        slope = np.zeros_like(flat)
        np.add.at(slope, other, pull)
        np.add.at(slope, one, -pull)
        return float((stretch**2).sum()), slope.ravel()

    found = minimize(
        strain, flat.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": STEPS, "ftol": 1e-12}
    )
    return _by_front(found.x.reshape(-1, 2))


def _nearest(places: Float64[Array, "N d"]) -> Int64[Array, "N k"]:
    near: Int64[Array, "N k"] = cKDTree(places).query(places, k=AROUND + 1)[1][:, 1:]
    return near
