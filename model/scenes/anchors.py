"""Observed points follow mass points: weights that reproduce every affine motion."""

import numpy as np
from jaxtyping import Float, Integer

from model.scenes.case import Anchors
from model.skinning import bind
from model.types import Array

FOLLOWED = 10
"""Mass points that each observed point follows."""
GIVE = 1e-4
"""How far, over the size of the neighbourhood, a point may be missed rather than have weights far apart."""


def anchor(
    observed: Float[Array, "N 3"], points: Float[Array, "P 3"], springs: Integer[Array, "E 2"]
) -> Anchors:
    r"""Find weights w over near mass points X with $\sum w = 1$ and $\sum w X = p$ for each observed point p.

    Of all such weights those nearest to the fall-off of `bind` (least squares), so that the observed point
    follows any affine motion of its neighbourhood, turns included, and stays linear in the mass points.
    Where the neighbours lie in a plane or on a line, what is off it is missed.

    Args:
        observed: Points on the object at rest [m].
        points: Mass points at rest [m].
        springs: Pairs of mass points: nothing is bound across a gap.

    Reference:
        Schaefer, McPhail and Warren (2006), Image deformation using moving least squares.
    """
    means, places = observed.astype(np.float32), points.astype(np.float32)
    index, weight = bind(means, places, k=min(FOLLOWED, len(points)), springs=springs)
    used = weight > 0.0
    offset = points.astype(np.float64)[index] - observed.astype(np.float64)[:, None]
    size = np.sqrt((offset**2).sum(axis=2).mean(axis=1)) + 1e-12
    conditions = np.concatenate([np.ones((*index.shape, 1)), offset / size[:, None, None]], axis=2)
    wanted = np.zeros((len(index), 4))
    wanted[:, 0] = 1.0
    conditions = np.where(used[..., None], conditions, 0.0)
    missing = wanted - np.einsum("nk,nkc->nc", weight.astype(np.float64), conditions)
    normal = np.einsum("nkc,nkd->ncd", conditions, conditions)
    normal[:, range(1, 4), range(1, 4)] += GIVE
    correction = np.einsum("nkc,nc->nk", conditions, np.linalg.solve(normal, missing[..., None])[..., 0])
    exact = np.where(used, weight + correction, 0.0)
    exact /= exact.sum(axis=1, keepdims=True)
    return Anchors(index.astype(np.int32), exact.astype(np.float32))
