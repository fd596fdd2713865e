"""A bent sheet laid out flat: where each of its points would be if it were unrolled."""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.laid_out import by_ways, eased, joined
from model.types import Array

AROUND = 10
"""Points that one is joined to, of which the way from any to any other is made."""
TRUE, NEARLY_ALL = (0.9, 1.1), 0.95
"""Laid out flat, so many neighbours are as far apart as they are but for these factors: of what hangs over a
ball a third as large, too; of what lies on itself they are not."""
EASED = 1e-12
"""A step that gains less than this share is the last."""


def unrolled(places: Float64[Array, "N 3"]) -> Float64[Array, "N 2"] | None:
    """Where the points of a sheet are in it [m], its longer axis first; None where nothing lays it out.

    From its front, if that shows distances between neighbours as they are; else such that the ways in it
    are as long as they are (Isomap), and
    from there neighbours as far apart as they are. What lies on itself, or hangs over what is thinner than
    points are apart, has its sides joined by mistake and is seldom laid out by either.

    Args:
        places: Points on it, more than `AROUND` [m].
    """
    front = _by_front(places)
    if _is_true(front, places):
        return front
    pairs = joined(_nearest(places))
    apart = np.maximum(np.linalg.norm(places[pairs[1]] - places[pairs[0]], axis=1), 1e-9)
    along = by_ways(len(places), pairs, apart, axes=2)
    if along is None:
        return None
    along = _by_front(eased(along, pairs, apart, until=EASED))
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


def _nearest(places: Float64[Array, "N d"]) -> Int64[Array, "N k"]:
    near: Int64[Array, "N k"] = cKDTree(places).query(places, k=AROUND + 1)[1][:, 1:]
    return near
