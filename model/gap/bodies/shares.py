"""How the mass of a body that is alike everywhere is shared among its points."""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.guess import Shape
from model.simulator.structure import cells, faces
from model.types import Array

MISSED = 0.2
"""Share of the points that no piece reaches where pieces say little of the rest: a net is irregular there."""
AROUND = 4
"""Nearest points, whose distance says how much is around a point."""
LEAST, MOST = 0.3, 3.0
"""Of the median: what has hardly any mass would need fine steps in time."""


def shares(
    points: Float64[Array, "P 3"], springs: Int64[Array, "E 2"], shape: Shape, spacing: float
) -> Float64[Array, " P"]:
    """Share of the mass of each point, sums to 1: of every piece between points each of these has as much.

    Points on the surface have less around them than those within: were all as heavy, a block would be as hard
    to turn as one that is a fifth larger. What is left of that, since corners are farther out than the piece
    between them, is made up for by as small a change as can be: middle and second moments are those of
    the pieces. A net so irregular that its pieces leave out many points has as much around each as its
    nearest are far.

    Args:
        points: At rest [m].
        springs: Pairs that are joined: of a rope its pieces, of a sheet the sides of its triangles.
        shape: What the body is.
        spacing: Usual distance of neighbours [m].
    """
    pieces, measure = _pieces(points, springs, shape, spacing)
    share = np.zeros(len(points))
    np.add.at(share, pieces, measure[:, None])
    if shape == "rope":  # points that are seen are seldom its very ends
        share *= np.where(np.bincount(springs.ravel(), minlength=len(points)) == 1, 2.0, 1.0)
    if shape == "sheet" and (share == 0.0).mean() > MISSED:
        share, pieces = _around(points), pieces[:0]
    usual = float(np.median(share[share > 0.0])) if (share > 0.0).any() else 1.0
    if shape != "rope" and len(pieces):
        share = _as_hard_to_turn(share, points, pieces, measure)
    share = np.clip(share, LEAST * usual, MOST * usual)
    whole: Float64[Array, " P"] = share / share.sum()
    return whole


def _around(points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
    """Of a sheet, square of how far the nearest points are on average."""
    near = cKDTree(points).query(points, k=min(AROUND + 1, len(points)))[0][:, 1:]
    around: Float64[Array, " P"] = near.mean(1) ** 2
    return around


def _as_hard_to_turn(
    share: Float64[Array, " P"],
    points: Float64[Array, "P 3"],
    pieces: Int64[Array, "n k"],
    measure: Float64[Array, " n"],
) -> Float64[Array, " P"]:
    r"""Shares nearest to these that have the mass, the middle and the second moments of the pieces.

    Those of a simplex of k corners x are its measure times $(\sum x x^T + \sum x \sum x^T) / (k (k + 1))$.
    """
    count = pieces.shape[1]
    own = (points - points.mean(0)) / max(float(points.std()), 1e-12)
    corners = own[pieces]
    total = corners.sum(1)
    second = np.einsum("nki,nkj->nij", corners, corners) + np.einsum("ni,nj->nij", total, total)
    second *= (measure / (count + 1))[:, None, None]
    upper = np.triu_indices(3)
    wanted = np.concatenate([[count * measure.sum()], measure @ total, second.sum(0)[upper]])
    moments = np.concatenate([np.ones((1, len(own))), own.T, (own[:, upper[0]] * own[:, upper[1]]).T])
    more = np.linalg.lstsq((moments * share) @ moments.T, wanted - moments @ share, rcond=1e-9)[0]
    changed: Float64[Array, " P"] = share * (1.0 + more @ moments)
    return changed


def _pieces(
    points: Float64[Array, "P 3"], springs: Int64[Array, "E 2"], shape: Shape, spacing: float
) -> tuple[Int64[Array, "n k"], Float64[Array, " n"]]:
    """Corners of what is between points, and its length, volume, or twice its area."""
    if shape == "solid":
        return cells(points, spacing)
    if shape == "sheet":
        corners = faces(points, springs)
        sides = points[corners[:, 1:]] - points[corners[:, :1]]
        return corners, np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return springs, np.linalg.norm(points[springs[:, 1]] - points[springs[:, 0]], axis=1)
