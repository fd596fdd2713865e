"""A cloth that lies folded upon itself in the first frame, laid open: where its points are in it.

What hangs from a corner is a bundle as thick as a solid, and points of two folds are neighbours that are far
apart in the cloth. But they part as it moves, and what is joined stays as near as it is.
"""

import warnings

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.laid_out import by_ways, eased, joined
from model.gap.bodies.neighbours import usual_distance
from model.types import Array

FRAMES = 120
"""Frames that are asked, at most."""
RARELY = 0.95
"""Points are as far apart as they are in all but so many of the frames: single ones have noise."""
BESIDE = 1.5
"""Distances to the third nearest point: what is nearer in the first frame is a neighbour there."""
PARTED = 0.06
"""Share of the neighbours that part by more than such a distance. Of solids none do, in 22 recordings by two
generators, nor of sheets that are spread out (0.05 at most, of 54); of cloths in a bundle 0.11 to 0.35."""
JOINED = 8
"""Points that stay nearest to a point: it is taken to be joined to them."""
APART = 0.3
"""What a pair counts that is nearer than it was seen to be, against neighbours that are not as far apart as
they are: no two points are farther apart in space than in the cloth."""
EASED = 10.0**7 * np.finfo(np.float64).eps
"""A step that gains less than this share is the last."""


def unfolded(points: Float[Array, "T N 3"], places: Float64[Array, "N 3"]) -> Float64[Array, "N 3"] | None:
    """Where points are in a cloth that is laid open [m]; None where it is not folded upon itself at first.

    Such that the ways in it are as long as they are (Isomap), and from there such that neighbours are as far
    apart as they ever are, and no others nearer than that. In space, not in the plane: a tube has no place
    there, and what never opens stays bent.

    Args:
        points: In each frame [m], NaN where not seen.
        places: In the first one, all known.
    """
    if len(places) <= JOINED or not _is_folded(points, places):
        return None
    apart = _ever_apart(points, places)
    away = apart + np.diag(np.full(len(apart), np.inf))
    pairs = joined(np.argsort(away, axis=1, kind="stable")[:, :JOINED])
    laid = by_ways(len(apart), pairs, apart[*pairs], axes=3)
    if laid is None:
        return None
    every = np.concatenate([pairs, np.stack(np.triu_indices(len(apart), 1))], axis=1)
    others = np.arange(every.shape[1]) >= pairs.shape[1]
    weight = np.where(others, APART, 1.0)
    return eased(laid, every, apart[*every], weight=weight, only_nearer=others, until=EASED)


def _is_folded(points: Float[Array, "T N 3"], places: Float64[Array, "N 3"]) -> bool:
    """Whether many neighbours of the first frame part."""
    unit = usual_distance(places, 3)
    pairs = cKDTree(places).query_pairs(BESIDE * unit, output_type="ndarray").T.astype(np.int64)
    if not pairs.size:
        return False
    at_first = np.linalg.norm(places[pairs[0]] - places[pairs[1]], axis=1)
    return bool((_farthest(points, pairs, at_first) > at_first + unit).mean() > PARTED)


def _farthest(
    points: Float[Array, "T N 3"], pairs: Int64[Array, "2 E"], at_first: Float64[Array, " E"]
) -> Float64[Array, " E"]:
    """How far apart pairs of points ever are [m]; as at first, if they are never seen together."""
    frames = np.unique(np.linspace(0, len(points) - 1, FRAMES).round().astype(int))
    seen = points[frames].astype(np.float64)
    away = np.linalg.norm(seen[:, pairs[0]] - seen[:, pairs[1]], axis=-1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        farthest = np.nanquantile(away, RARELY, axis=0)
    known: Float64[Array, " E"] = np.where(np.isfinite(farthest), farthest, at_first)
    return known


def _ever_apart(points: Float[Array, "T N 3"], places: Float64[Array, "N 3"]) -> Float64[Array, "N N"]:
    """How far apart all points ever are [m]."""
    pairs = np.stack(np.triu_indices(len(places), 1))
    at_first = np.linalg.norm(places[pairs[0]] - places[pairs[1]], axis=1)
    apart = np.zeros((len(places), len(places)))
    apart[*pairs] = apart[*pairs[::-1]] = np.maximum(_farthest(points, pairs, at_first), 1e-9)
    return apart
