"""The tensions with which a body is at rest under its weight."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import coo_matrix, csr_matrix, diags, identity
from scipy.sparse.linalg import SuperLU, lsqr, splu

from model.types import Array

RELUCTANCE = 0.02
"""How strongly small tensions are preferred, against an exact balance."""
FIRMER = 5.0
"""A hand or the ground gives way by so much less than a spring."""
ROUNDS = 100
"""At most, until it is known which springs press."""
LEAST_STEP = 1e-6
"""Of a step of Newton's: so little of it gains nothing."""


@dataclass(frozen=True)
class Balance:
    """The forces of springs and of what bears a body on its points.

    Columns of `matrix` are springs, then three for each point that is borne, which `held` are, as firmly
    as `firm` says; each spring's as large as the root of its `give`.
    """

    matrix: csr_matrix
    give: Float64[Array, " E"]
    """Of each spring, how strongly it bears what it bears, 0..1."""
    held: Int64[Array, " h"]
    firm: Float64[Array, " h"]

    def more(self, weights: Float64[Array, "b P 3"]) -> tuple[Float64[Array, "b E"], Float64[Array, "b P 3"]]:
        """How much more springs and what bears them pull [N] where more weighs on the points [N].

        As long as no other springs press than did: the same least squares, which are linear then.
        """
        loads, springs = -weights.reshape(len(weights), -1), len(self.give)
        found = (self.matrix.T @ self._solver.solve(loads.T)).T
        supports = np.zeros_like(weights)
        supports[:, self.held] = found[:, springs:].reshape(len(weights), -1, 3) * self.firm[:, None]
        return found[:, :springs] * np.sqrt(self.give), supports

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
    pressing: float = 1.0,
) -> Rest:
    """The tensions, and the forces of what bears it, with which every point of a body is in balance.

    A least-squares solution, the smallest of those that balance: a body is seldom at ease in the shape in
    which it is first seen. It depends on the shape and the weight alone, not on any stiffness: a spring of
    stiffness k and length d then has the rest length d − tension / k, one that presses with `pressing` of k.

    Args:
        points: Where the body is at rest [m].
        springs: Pairs of points.
        weights: External force on each point [N].
        bearing: How firmly a hand or the ground bears each point, 0..1: of two that are borne, the firmer one
            takes more.
        pressing: How stiff springs are against compression, of what they are against tension: the less, the
            less of it they are asked to bear.
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
    if pressing == 1.0:
        found, give = lsqr(balance, -weights.ravel(), damp=RELUCTANCE, iter_lim=400)[0], np.ones(len(springs))
    else:
        found, give = _wrinkling(balance, -weights.ravel(), len(springs), pressing)
        balance = balance @ diags(np.sqrt(np.concatenate([give, np.ones(3 * len(held))])))
    supports = np.zeros((len(points), 3))
    supports[held] = found[len(springs) :].reshape(-1, 3) * firm[:, None]
    known = Balance(balance, give, held, firm)
    return Rest(found[: len(springs)], supports, known, known)


def _wrinkling(
    balance: csr_matrix, load: Float64[Array, " m"], springs: int, pressing: float
) -> tuple[Float64[Array, " n"], Float64[Array, " E"]]:
    """The same with springs, which come first, that are softer where they press: pulls, and how they give.

    Points move against springs until these bear the load; those that are shorter then press. Newton's method
    in these moves, of which the energy is convex and piecewise quadratic; steps are halved until they gain.

    Args:
        balance: Forces on points, of each spring and of what bears them.
        load: What they are to balance [N].
        springs: How many of the columns are springs.
        pressing: How stiff they are against compression, of what they are against tension.
    """

    def giving(moves: Float64[Array, " m"]) -> tuple[Float64[Array, " n"], Float64[Array, " n"], float]:
        longer = balance.T @ moves
        give = np.ones(len(longer))
        give[:springs][longer[:springs] < 0.0] = pressing
        energy = 0.5 * float(give @ longer**2 + RELUCTANCE**2 * moves @ moves) - float(load @ moves)
        return longer, give, energy

    moves = np.zeros(len(load))
    longer, give, energy = giving(moves)
    stiff = RELUCTANCE**2 * identity(len(load))
    for _ in range(ROUNDS):
        step = splu((balance @ diags(give) @ balance.T + stiff).tocsc()).solve(load) - moves
        share = 1.0
        while (there := giving(moves + share * step))[2] > energy and share > LEAST_STEP:
            share *= 0.5
        moves, before = moves + share * step, give
        longer, give, energy = there
        if share == 1.0 and np.array_equal(give, before):
            break
    return give * longer, give[:springs]
