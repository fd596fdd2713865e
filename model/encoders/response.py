"""Which changes of constants would explain what was seen: linear least squares with honest spreads."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from model.types import Array

ALIKE = 40.0
"""Measurements that err alike: what a twin cannot follow spoils many points and frames in the same way."""
NOISE = 5e-4
"""Errors below which nothing is told apart [m]."""
FAR = 3.0
"""Residuals count less from this multiple of their usual size on: lost tracks."""
PASSES = 3
BEFORE = (2.0, 1.2, 1.2, 0.7, 1.0)
"""Spreads of constants around those of a twin of reference, before anything is seen: of the modulus of a
part, then of dashpot, drag, friction (ln) and restitution (logit)."""


@dataclass(frozen=True)
class Answer:
    """Changes of V constants, and how sure they are."""

    change: Float64[Array, " V"]
    spread: Float64[Array, " V"]
    """Standard deviations; where nothing was learned they are those before."""
    error: float
    """Usual size of what is left [m]."""


def spreads_before(parts: int) -> Float64[Array, " V"]:
    """`BEFORE` for each part's modulus and for the global constants."""
    return np.array([BEFORE[0]] * parts + [*BEFORE[1:]])


def explain(
    residual: Float64[Array, "U N 3"],
    response: Float64[Array, "V U N 3"],
    known: Bool[Array, "U N"],
    before: Float64[Array, " V"],
) -> Answer:
    r"""Most probable changes $\theta$ of constants with $r \approx J\theta$.

    $\theta$ is normal around 0 with spreads `before`, errors are normal with the size that the residuals turn
    out to have, `ALIKE` of them counting as one; outliers are weighted down (Cauchy).

    Args:
        residual: Seen minus simulated [m]; 0 where not known.
        response: Change of the simulated per unit of each constant [m]; 0 where not known.
        known: Where there are measurements.
        before: Standard deviation of each constant before.

    Reference:
        Holland and Welsch (1977), Robust regression using iteratively reweighted least-squares.
    """
    weight = known.astype(np.float64)
    if not weight.any():
        return Answer(np.zeros(len(before)), before.copy(), NOISE)
    change, covariance, variance = np.zeros(len(before)), np.diag(before**2), NOISE**2
    for _ in range(PASSES):
        left = residual - np.tensordot(change, response, axes=1)
        square = (left**2).sum(axis=-1)
        variance = max(float((weight * square).sum() / (3.0 * weight.sum())), NOISE**2)
        weight = known / (1.0 + square / (3.0 * FAR**2 * variance))
        weighted = (response * weight[..., None]).reshape(len(before), -1)
        scale = 1.0 / (ALIKE * variance)
        precision = scale * weighted @ response.reshape(len(before), -1).T + np.diag(before**-2.0)
        covariance = np.linalg.inv(precision)
        change = scale * covariance @ (weighted @ residual.reshape(-1))
    return Answer(change, np.sqrt(np.diag(covariance)), float(np.sqrt(variance)))
