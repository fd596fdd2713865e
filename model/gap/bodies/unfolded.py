"""A cloth that lies folded upon itself in the first frame, laid open: where its points are in it.

What hangs from a corner is a bundle as thick as a solid, and points of two folds are neighbours that are far
apart in the cloth. But they part as it moves, and what is joined stays as near as it is.
"""

import warnings

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64
from scipy.optimize import minimize
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

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
STEPS = 1000
"""At most, to ease what was laid out by ways."""


def unfolded(points: Float[Array, "T N 3"], places: Float64[Array, "N 3"]) -> Float64[Array, "N 3"] | None:
    """Where points are in a cloth that is laid open [m]; None where it is not folded upon itself at first.

    Such that the ways in it are as long as they are (Isomap: J. B. Tenenbaum, V. de Silva, J. C. Langford,
    Science 290 (2000)), and from there such that neighbours are as far apart as they ever are, and no others
    nearer than that. In space, not in the plane: a tube has no place there, and what never opens stays bent.

    Args:
        points: In each frame [m], NaN where not seen.
        places: In the first one, all known.
    """
    if len(places) <= JOINED or not _is_folded(points, places):
        return None
    apart = _ever_apart(points, places)
    joined = _joined(apart)
    steps = coo_matrix((apart[*joined], joined), apart.shape)
    ways = dijkstra(steps.tocsr(), directed=False)
    if not np.isfinite(ways).all():
        return None
    return _eased(_laid_out(ways), apart, joined)


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


def _joined(apart: Float64[Array, "N N"]) -> Int64[Array, "2 E"]:
    """Pairs of each point and those that stay nearest to it."""
    away = apart + np.diag(np.full(len(apart), np.inf))
    near = np.argsort(away, axis=1, kind="stable")[:, :JOINED]
    pairs = np.stack([np.repeat(np.arange(len(near)), JOINED), near.ravel()], axis=1)
    joined: Int64[Array, "2 E"] = np.unique(np.sort(pairs, axis=1), axis=0).T
    return joined


def _laid_out(ways: Float64[Array, "N N"]) -> Float64[Array, "N 3"]:
    """Places that are as far apart as ways are long, as nearly as can be."""
    square = ways**2
    inner = -0.5 * (square - square.mean(0) - square.mean(1)[:, None] + square.mean())
    values, vectors = np.linalg.eigh(inner)
    places: Float64[Array, "N 3"] = vectors[:, :-4:-1] * np.sqrt(values[:-4:-1].clip(0))
    return places


def _strain(
    places: Float64[Array, "N 3"], apart: Float64[Array, "N N"], pairs: Int64[Array, "2 E"]
) -> Float64[Array, " E"]:
    """Of each pair, by how much it is farther apart than it should be [1]."""
    now = np.linalg.norm(places[pairs[1]] - places[pairs[0]], axis=1)
    strain: Float64[Array, " E"] = now / apart[*pairs] - 1.0
    return strain


def _eased(
    places: Float64[Array, "N 3"], apart: Float64[Array, "N N"], joined: Int64[Array, "2 E"]
) -> Float64[Array, "N 3"]:
    """The least strained, from where ways that zigzag between points have put them."""
    every = np.stack(np.triu_indices(len(places), 1))
    pairs = np.concatenate([joined, every], axis=1)
    only_nearer: Bool[Array, " E"] = np.arange(pairs.shape[1]) >= joined.shape[1]
    count = np.where(only_nearer, APART, 1.0)
    wanted = apart[*pairs]

    def cost(at: Float64[Array, " n"]) -> tuple[float, Float64[Array, " n"]]:
        """Sum of squares, and its slope."""
        now = at.reshape(places.shape)
        strain = _strain(now, apart, pairs)
        strain[only_nearer] = np.minimum(strain[only_nearer], 0.0)
        way = now[pairs[1]] - now[pairs[0]]
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        pull = (2.0 * count * strain / (wanted * length))[:, None] * way
        slope = np.zeros_like(now)
        np.add.at(slope, pairs[1], pull)
        np.add.at(slope, pairs[0], -pull)
        return float((count * strain**2).sum()), slope.ravel()

    found = minimize(cost, places.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": STEPS})
    eased: Float64[Array, "N 3"] = found.x.reshape(places.shape)
    return eased
