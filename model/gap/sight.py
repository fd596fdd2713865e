"""Which places of an object are seen."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.gap.bodies.aside import LEAST, Aside


@dataclass(frozen=True)
class Skin:
    """Places on the skin of a rope, beside the line of its points: see `Aside`."""

    offset: Float[Tensor, "N 3"]
    """From the line [m], in the pose in which it runs `along`."""
    along: Float[Tensor, "N 3"]
    ends: Int[Tensor, "N 2"]
    """The points by which the line's direction is told."""

    @classmethod
    def of(cls, aside: Aside, dtype: torch.dtype) -> "Skin":
        """Of a body, in these numbers."""
        offset, along = (torch.from_numpy(one).to(dtype) for one in (aside.offset, aside.along))
        return cls(offset, along, torch.from_numpy(aside.ends))

    def __call__(self, points: Float[Tensor, "*b P 3"]) -> Float[Tensor, "*b N 3"]:
        """The offsets [m] where the line's points are at `points` [m]."""
        first, last = (points[..., end, :] for end in self.ends.unbind(1))
        way = last - first
        now = way / way.norm(dim=-1, keepdim=True).clamp_min(1e-12)
        before, offset = self.along.expand(now.shape), self.offset.expand(now.shape)
        axis = torch.linalg.cross(before, now)
        cosine = (before * now).sum(-1, keepdim=True)
        lean = (axis * offset).sum(-1, keepdim=True) / (1.0 + cosine).clamp_min(LEAST)
        turned: Tensor = cosine * offset + torch.linalg.cross(axis, offset) + lean * axis
        return turned


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
