"""Which places of an object are seen."""

from dataclasses import dataclass

from jaxtyping import Float, Int
from torch import Tensor

from model.gap.bodies.aside import Skin


@dataclass(frozen=True)
class Sight:
    """Which places of the object are seen: each is a weighted mean of mass points, or beside it."""

    index: Int[Tensor, "N k"]
    weight: Float[Tensor, "N k"]
    """Sums to 1 over k."""
    skin: Skin | None = None
    """Where they are beside that; None: they are there."""

    def __call__(self, points: Float[Tensor, "*b P 3"]) -> Float[Tensor, "*b N 3"]:
        """The seen places [m] of mass points at `points` [m]."""
        corners = points[..., self.index, :]
        seen: Tensor = (self.weight.unsqueeze(-1) * corners).sum(-2)
        return seen if self.skin is None else seen + self.skin(points)

    def spread(self, values: Float[Tensor, " P"]) -> Float[Tensor, " N"]:
        """One number for each mass point as one for each seen place."""
        spread: Tensor = (self.weight * values[self.index]).sum(-1)
        return spread
