"""What is believed of coordinates beside what is seen, and how much that counts."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from model.gap.blocks import independent_share
from model.types import Array

LOOSE = 3.0
"""Standard deviation of a coordinate of which nothing is known beforehand: what frames say nothing of stays
near where a fit begins."""


@dataclass(frozen=True)
class Belief:
    """A normal distribution of each coordinate, as one more residual for each."""

    centre: Float64[Array, " d"]
    spread: Float64[Array, " d"]
    """Standard deviations."""
    unit: Float64[Array, " d"]
    """How large a residual is that is one standard deviation off."""

    @classmethod
    def loose(cls, centre: Float64[Array, " d"]) -> "Belief":
        """Near a place, each coordinate by itself; one standard deviation counts as one residual of noise."""
        return cls(centre, np.full(len(centre), LOOSE), np.ones(len(centre)))

    @property
    def weight(self) -> Float64[Array, " d"]:
        """Slope of each residual."""
        weight: Float64[Array, " d"] = self.unit / self.spread
        return weight

    @property
    def precision(self) -> Float64[Array, "d d"]:
        """Of the residuals, as they are fitted along: slopes squared."""
        return np.diag(self.weight**2)

    @property
    def scatter(self) -> Float64[Array, "d d"]:
        """Covariance of slopes times residuals, were what is believed drawn anew."""
        return np.diag((self.weight * self.unit) ** 2)

    def residuals(self, vector: Float64[Array, " d"]) -> Float64[Array, " d"]:
        """One a coordinate."""
        off: Float64[Array, " d"] = self.weight * (vector - self.centre)
        return off


def residual_unit(field: Float64[Array, "F N k"], seen: Bool[Array, "F N"]) -> float:
    r"""How large a residual is that says as much as one standard deviation of what is believed.

    Residuals are told in standard deviations of the sensor's noise. What a twin leaves is more, for no
    lattice is the world, and it hangs together in time and among points: m of them say as much as $s m$ that
    are independent, of variance $c$. What is believed then counts $\sqrt{c / s}$ times as much beside them as
    it would beside noise alone; else thousands of residuals would overrule it for the least of errors.

    Args:
        field: Residuals, zero where nothing was seen.
        seen: Where something was.

    Reference:
        Miller and Dunson (2019), Robust Bayesian inference via coarsening, Journal of the American
        statistical association 114 (a likelihood to the power of a share of what it claims to say).
    """
    left = float((field**2).sum()) / max(field.shape[-1] * int(seen.sum()), 1)
    return float(np.sqrt(max(left, 1.0) / independent_share(field, seen)))
