"""The tensions with which a body is at rest under its weight."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import nnls
from scipy.sparse import coo_matrix, csr_matrix, diags, identity, vstack
from scipy.sparse.linalg import SuperLU, lsqr, splu

from model.types import Array

RELUCTANCE = 0.02
"""How strongly small tensions are preferred, against an exact balance."""
FIRMER = 5.0
"""A hand or the ground gives way by so much less than a spring."""
ROUNDS = 10
"""For each spring, at most, until tensions are found that may not be below zero."""


@dataclass(frozen=True)
class Balance:
    """The forces of springs and of what bears a body on its points.

    Columns of `matrix` are springs, then three for each point that is borne, which `held` are, as firmly
    as `firm` says. Those of springs that are slack are empty.
    """

    matrix: csr_matrix
    springs: int
    held: Int64[Array, " h"]
    firm: Float64[Array, " h"]

    def more(self, weights: Float64[Array, "b P 3"]) -> tuple[Float64[Array, "b E"], Float64[Array, "b P 3"]]:
        """How much more springs and what bears them pull [N] where more weighs on the points [N].

        As long as no other springs are slack than were: the same least squares, which are linear then.
        """
        loads = -weights.reshape(len(weights), -1)
        found = (self.matrix.T @ self._solver.solve(loads.T)).T
        supports = np.zeros_like(weights)
        supports[:, self.held] = found[:, self.springs :].reshape(len(weights), -1, 3) * self.firm[:, None]
        return found[:, : self.springs], supports

    @cached_property
    def _solver(self) -> SuperLU:
        rows = self.matrix.shape[0]
        return splu((self.matrix @ self.matrix.T + RELUCTANCE**2 * identity(rows)).tocsc())


@dataclass(frozen=True)
class Rest:
    """What keeps a body in its place."""

    tensions: Float64[Array, " E"]
    """Of each spring [N]."""
    supports: Float64[Array, "P 3"]
    """What a hand or the ground does to each point [N]."""
    within: Balance
    """That of the tensions."""
    around: Balance
    """That of the supports: of a body that is held elsewhere now than where its lengths were told it is
    another."""

    def more(self, weights: Float64[Array, "b P 3"]) -> tuple[Float64[Array, "b E"], Float64[Array, "b P 3"]]:
        """How much more springs, and what bears the body, pull where more weighs on its points [N]."""
        tensions, supports = self.within.more(weights)
        return tensions, supports if self.around is self.within else self.around.more(weights)[1]


def resting(
    points: Float64[Array, "P 3"],
    springs: Int64[Array, "E 2"],
    weights: Float64[Array, "P 3"],
    bearing: Float64[Array, " P"],
    *,
    presses: bool = True,
) -> Rest:
    """The tensions, and the forces of what bears it, with which every point of a body is in balance.

    A least-squares solution, the smallest of those that balance: a body is seldom at ease in the shape in
    which it is first seen. It depends on the shape and the weight alone, not on any stiffness: a spring of
    stiffness k and length d then has the rest length d − tension / k.

    Args:
        points: Where the body is at rest [m].
        springs: Pairs of points.
        weights: External force on each point [N].
        bearing: How firmly a hand or the ground bears each point, 0..1: of two that are borne, the firmer one
            takes more.
        presses: Springs bear compression as well; else their tensions are not below zero.
    """
    way = points[springs[:, 1]] - points[springs[:, 0]]
    axis = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    edge = np.arange(len(springs))
    rows = np.concatenate([3 * springs[:, end, None] + np.arange(3) for end in (0, 1)]).ravel()
    columns = np.tile(np.repeat(edge, 3), 2)
    entries = np.concatenate([axis, -axis]).ravel()
    held = np.flatnonzero(bearing > 0)
    firm = FIRMER * bearing[held]
    rows = np.concatenate([rows, (3 * held[:, None] + np.arange(3)).ravel()])
    columns = np.concatenate([columns, len(springs) + np.arange(3 * len(held))])
    entries = np.concatenate([entries, np.repeat(firm, 3)])
    shape = 3 * len(points), len(springs) + 3 * len(held)
    balance = coo_matrix((entries, (rows, columns)), shape=shape).tocsr()
    if presses:
        found = lsqr(balance, -weights.ravel(), damp=RELUCTANCE, iter_lim=400)[0]
    else:
        found = _pulling(balance, -weights.ravel(), len(springs))
        balance = balance @ diags(np.where(np.arange(shape[1]) < len(springs), found > 0.0, 1.0))
    supports = np.zeros((len(points), 3))
    supports[held] = found[len(springs) :].reshape(-1, 3) * firm[:, None]
    known = Balance(balance, len(springs), held, firm)
    return Rest(found[: len(springs)], supports, known, known)


def _pulling(balance: csr_matrix, load: Float64[Array, " m"], springs: int) -> Float64[Array, " n"]:
    """The same with springs, which come first, that only pull.

    Exactly so, by an active set: methods from the inside end somewhere near, by rounding, with tensions that
    nothing asks for.

    Reference:
        Lawson and Hanson (1974), Solving least squares problems, chapter 23 (non-negative least squares).
    """
    unit = max(float(np.abs(load).max()), 1e-12)
    count = balance.shape[1]
    reluctant = vstack([balance, RELUCTANCE * identity(count)]).toarray()
    wanted = np.concatenate([load / unit, np.zeros(count)])
    pulling, bearing = reluctant[:, :springs], reluctant[:, springs:]
    # what bears does its best whatever springs do: they are left what it cannot
    borne = np.linalg.qr(bearing)[0]
    left = (each - borne @ (borne.T @ each) for each in (pulling, wanted))
    tensions = nnls(*left, maxiter=ROUNDS * springs)[0]
    supports = np.linalg.lstsq(bearing, wanted - pulling @ tensions, rcond=None)[0]
    solution: Float64[Array, " n"] = np.concatenate([tensions, supports]) * unit
    return solution
