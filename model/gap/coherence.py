"""What neighbours have in common in what a prediction misses: a gap is shared, noise is not."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.body import Body
from model.types import Array

PARTNERS = 6
"""With which a point's innovations are compared."""
LOOKED_AT = 96
"""Nearest points among which partners are looked for."""
OUTLIER = 99.0
"""Percentile of the innovations' lengths beyond which they are shortened."""
FLIPS = 999
RATE = 0.05
"""Of bins that are called significant, at most so many are not, on average."""


@dataclass(frozen=True)
class Coherence:
    """Products of the innovations of a point and of its partners.

    The partners of a point are the nearest points that hang on no mass point of its own, so that noise of
    the first frame, from which the mass points are, is not shared. The mean of the product is the squared
    innovation less the noise, without the noise having to be known; less, too, what of the noise the observer
    carries into the next predictions, which neighbours share.
    """

    innovations: Float64[Array, "T N 3"]
    """Over their noise; zero where not seen; the outliers shortened."""
    seen: Bool[Array, "T N"]
    partners: Int64[Array, "N k"]
    """Empty, with k = 0, where a point has none: then one noise is taken off the square."""
    carried: float
    """Share of the noise that is in predictions."""

    @classmethod
    def of(
        cls,
        innovations: Float64[Array, "T N 3"],
        seen: Bool[Array, "T N"],
        places: Float64[Array, "N 3"],
        body: Body,
        carried: float = 0.0,
    ) -> "Coherence":
        """Of innovations over noise, of points at `places` [m] at rest."""
        length = np.linalg.norm(innovations, axis=-1)
        most = float(np.percentile(length[seen], OUTLIER)) if seen.any() else 0.0
        shorter = innovations * np.minimum(1.0, most / np.maximum(length, 1e-12))[..., None]
        shorter[~seen] = 0.0
        return cls(shorter, seen, _partners(places, body), carried)

    def energy(self) -> Float64[Array, "T N"]:
        """Squared innovation over noise, less what is noise; below zero by chance; zero where not seen."""
        if not self.partners.shape[1]:
            own: Float64[Array, "T N"] = ((self.innovations**2).sum(-1) - 3.0) * self.seen
            return own
        energy: Float64[Array, "T N"] = self._products().sum(-1)
        return energy

    def counted(self) -> Bool[Array, "T N"]:
        """Which of the energies are of something."""
        if not self.partners.shape[1]:
            return self.seen
        counted: Bool[Array, "T N"] = self.seen & self.seen[:, self.partners].any(-1)
        return counted

    def _products(self) -> Float64[Array, "T N k"]:
        """Of each point with each partner, over the number of partners that are seen."""
        pair = self.seen[..., None] & self.seen[:, self.partners]
        own = (self.innovations**2).sum(-1)
        noise = 0.5 * self.carried * (own[..., None] + own[:, self.partners])
        product = np.einsum("tnx,tnkx->tnk", self.innovations, self.innovations[:, self.partners])
        products: Float64[Array, "T N k"] = (product - noise) * pair / np.maximum(pair.sum(-1), 1)[..., None]
        return products

    def chances(
        self, body: Body, part: Int64[Array, " N"], phase: Int64[Array, " T"]
    ) -> tuple[Float64[Array, "g h"], float]:
        """How likely noise alone has as much energy in each part and phase, and in the largest of them.

        Noise is as likely one way as the other and independent between mass points: the innovations of all
        points that are nearest to one mass point are turned round together, at random.

        Reference:
            Winkler et al. (2014), Permutation inference for the general linear model, NeuroImage 92 (sign
            flips of symmetric errors, the maximum over all tests).
        """
        parts, spans = int(part.max()) + 1, int(phase.max()) + 1
        if not self.partners.shape[1]:
            return np.ones((parts, spans)), 1.0
        unit = body.index[np.arange(len(part)), body.weight.argmax(1)]
        one, other = np.repeat(np.arange(len(part)), self.partners.shape[1]), self.partners.ravel()
        flat = self._products().reshape(len(phase), -1)
        spell = np.stack([flat[phase == h].sum(0) for h in range(spans)])
        rng = np.random.default_rng(0)
        signs = rng.choice([-1.0, 1.0], size=(FLIPS, int(unit.max()) + 1))
        turned = signs[:, unit[one]] * signs[:, unit[other]]
        inside = [part[one] == g for g in range(parts)]
        found = np.stack([spell[:, rows].sum(1) for rows in inside])
        noise = np.stack([turned[:, rows] @ spell[:, rows].T for rows in inside], 1)
        scale = np.sqrt((noise**2).mean(0)) + 1e-12
        largest = (noise / scale).max((1, 2))
        of_all = (1.0 + (largest >= (found / scale).max()).sum()) / (1.0 + FLIPS)
        return (1.0 + (noise >= found).sum(0)) / (1.0 + FLIPS), float(of_all)


def discoveries(chances: Float64[Array, "*b"]) -> Bool[Array, "*b"]:
    """Which of many tests are significant, few of them wrongly.

    Reference:
        Benjamini and Hochberg (1995), Controlling the false discovery rate, Journal of the Royal Statistical
        Society B 57, procedure (1).
    """
    ordered = np.sort(chances, axis=None)
    allowed = RATE * np.arange(1, len(ordered) + 1) / len(ordered)
    below = np.flatnonzero(ordered <= allowed)
    found: Bool[Array, "*b"] = chances <= (ordered[below[-1]] if len(below) else -1.0)
    return found


def _partners(places: Float64[Array, "N 3"], body: Body) -> Int64[Array, "N k"]:
    """The nearest points that hang on other mass points, or the farthest of the near ones."""
    count = min(LOOKED_AT, len(places) - 1)
    if count < 1:
        return np.zeros((len(places), 0), np.int64)
    near = cKDTree(places).query(places, k=count + 1)[1]
    own = np.arange(len(places))
    order = np.stack([row[row != i][:count] for i, row in zip(own, near, strict=True)])
    shared = (body.index[order][..., None] == body.index[:, None, None, :]).any((-1, -2))
    rank = np.where(shared, 2 * count - np.arange(count), np.arange(count))
    best = np.argsort(rank, axis=1, kind="stable")[:, :PARTNERS]
    return np.take_along_axis(order, best, 1).astype(np.int64)


def carried_noise(patience: float, interval: float) -> float:
    """Variance of an observer's predictions by noise alone, over that of the noise.

    Args:
        patience: Of the observer [s].
        interval: Between frames [s].

    Reference:
        Benedict and Bordner (1962), Synthesis of an optimal set of radar track-while-scan smoothing
        equations, IRE Transactions on Automatic Control 7 (variance of the predicted position).
    """
    if np.isinf(patience):
        return 0.0
    alpha = 1.0 - float(np.exp(-interval / patience))
    beta = alpha**2 / (2.0 - alpha)
    return (2.0 * alpha**2 + 2.0 * beta + alpha * beta) / (alpha * (4.0 - 2.0 * alpha - beta))
