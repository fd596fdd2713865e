"""Errors of the points that are seen → the smooth error of all points that explains them."""

import numpy as np
from jaxtyping import Bool, Float, Float64

from model.scenes.case import Case
from model.types import Array

REACH = 0.12
"""How far apart points' errors are alike, over the size of the object at rest."""
NOISE = 0.1
"""Variance of what the sensor adds, over that of the errors."""


class Kriging:
    """The most probable error of every point, given noisy errors of some.

    Errors of two points at rest d apart are believed to be as alike as exp(−d² / 2ℓ²). Of a point far from
    all that were seen, nothing is said: zero. With one camera an error is known across the lines of sight
    alone; along them it is what the others make most probable.

    Reference:
        Rasmussen and Williams (2006), Gaussian processes for machine learning, MIT Press, eq. 2.23.
    """

    def __init__(self, case: Case) -> None:
        """Of the observed and the mass points of `case`."""
        rest = case.rest.astype(np.float64)
        reach = REACH * max(float(np.linalg.norm(np.ptp(rest, axis=0))), 1e-9)
        self._observed = _alike(rest, rest, reach)
        self._mass = _alike(case.topology.points.astype(np.float64), rest, reach)
        self._camera = None if case.camera is None else case.camera.position.astype(np.float64)

    def __call__(
        self, error: Float64[Array, "N 3"], there: Bool[Array, " N"], places: Float64[Array, "N 3"]
    ) -> tuple[Float64[Array, "P 3"], Float64[Array, "N 3"]]:
        """Errors [m] of all mass points and of all observed ones.

        Args:
            error: Seen minus expected of each observed point [m]; read where `there`.
            there: Which points are seen.
            places: Where they are seen [m]; read where `there`.
        """
        some = np.flatnonzero(there)
        alike = self._observed[np.ix_(some, some)]
        if self._camera is None:
            weight = np.linalg.solve(alike + NOISE * np.eye(len(some)), error[some])
        else:
            across = _across(places[some] - self._camera)
            count = 2 * len(some)
            both = (np.einsum("iac,jbc->iajb", across, across) * alike[:, None, :, None]).reshape(
                count, count
            )
            measured = np.einsum("iac,ic->ia", across, error[some]).reshape(count)
            solved = np.linalg.solve(both + NOISE * np.eye(count), measured)
            weight = np.einsum("ia,iac->ic", solved.reshape(-1, 2), across)
        return self._mass[:, some] @ weight, self._observed[:, some] @ weight


def _alike(a: Float64[Array, "n 3"], b: Float64[Array, "m 3"], reach: float) -> Float64[Array, "n m"]:
    apart = np.linalg.norm(a[:, None] - b[None], axis=-1)
    return np.asarray(np.exp(-0.5 * (apart / reach) ** 2))


def _across(rays: Float[Array, "n 3"]) -> Float64[Array, "n 2 3"]:
    """Two directions across each line of sight."""
    sight = rays / np.maximum(np.linalg.norm(rays, axis=-1, keepdims=True), 1e-9)
    other = np.eye(3)[np.abs(sight).argmin(axis=-1)]
    first = np.cross(sight, other)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(sight, first)], axis=1)
