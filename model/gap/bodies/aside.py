"""What is seen of a thick rope: places on its skin, beside the middle line that its twin is."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from model.types import Array

LOWEST = 0.1
"""Share of the line below which it lies, if any of it does."""
BESIDE = 2
"""Points of the line, before and behind each, that say how it runs there."""
FACING = 8
"""How much more a point tells of how the line is rolled that runs as it did; one that is turned round tells
nothing."""
LEAST = 1e-6
"""Of one and the cosine of a turn: what is turned round has no least turn, and any does."""


@dataclass(frozen=True)
class Aside:
    """How far seen places are beside a line in some pose, and how it runs there.

    A chain has no skin. Where it bends, what is seen of its skin goes along, as that of a rope that is not
    twisted: normals are carried from point to point of the line, here as in that pose, and turn no more than
    they must. How it is rolled about itself as a whole its points do not say: by as little as what runs much
    as it did allows.

    Reference:
        Bishop (1975), There is more than one way to frame a curve, American mathematical monthly 82.
    """

    offset: Float64[Array, "N 3"]
    """From the line [m]; 0 of places that are not seen."""
    nearest: Int64[Array, " N"]
    """The point of the line that each is beside."""
    along: Float64[Array, "P 3"]
    """Direction of the line at its points; unit vectors."""
    normal: Float64[Array, "P 3"]
    """Across it, carried along; unit vectors."""

    @classmethod
    def of(
        cls,
        seen: Float64[Array, "N 3"],
        points: Float64[Array, "P 3"],
        index: Int64[Array, "N k"],
        weight: Float64[Array, "N k"],
    ) -> "Aside":
        """In the pose in which seen places and the line's points, in their order, are.

        Args:
            seen: [m]; NaN where one is not seen.
            points: Of the line [m].
            index: The points that each seen place is between.
            weight: Of these, sums to 1.
        """
        away = seen - (weight[..., None] * points[index]).sum(1)
        along = directions(torch.from_numpy(points)).numpy()
        nearest = index[np.arange(len(index)), weight.argmax(1)]
        return cls(np.where(np.isfinite(away), away, 0.0), nearest, along, _carried(along))

    @property
    def radius(self) -> float:
        """How far the skin is from the line, of most places [m]."""
        away = np.linalg.norm(self.offset, axis=1)
        return float(np.median(away[away > 0.0])) if (away > 0.0).any() else 0.0

    def height(self, points: Float64[Array, "P 3"], ground: float | None) -> float:
        """How far above the ground the line of a rope that lies on it is [m]: as the skin is away from it.

        Less where some of the line is nearer to the ground in this pose, which nothing lifts from there: more
        than what an end or two are off.

        Args:
            points: Of the line [m].
            ground: Its height [m]; None: there is none.
        """
        if ground is None:
            return 0.0
        return max(0.0, min(self.radius, float(np.quantile(points[:, 2], LOWEST)) - ground))

    def rolled(self, turn: Float64[Array, "3 3"]) -> "Aside":
        """The same of a body that is turned as a whole, by this matrix of rotation."""
        offset, along, normal = (each @ turn.T for each in (self.offset, self.along, self.normal))
        return replace(self, offset=offset, along=along, normal=normal)

    def turned(self, points: Float64[Array, "P 3"]) -> Float64[Array, "N 3"]:
        """The offsets in another pose of the line [m]."""
        offsets: Float64[Array, "N 3"] = Skin.of(self, torch.float64)(torch.from_numpy(points)).numpy()
        return offsets


@dataclass(frozen=True)
class Skin:
    """The same, of many poses at once."""

    shares: Float[Tensor, "3 N 1"]
    """Of each offset, along the line, along its normal, and across both [m]."""
    nearest: Int64[Tensor, " N"]
    along: Float[Tensor, "P 3"]
    normal: Float[Tensor, "P 3"]

    @classmethod
    def of(cls, aside: Aside, dtype: torch.dtype) -> "Skin":
        """In these numbers."""
        across = np.cross(aside.along, aside.normal)
        axes = (each[aside.nearest] for each in (aside.along, aside.normal, across))
        shares = np.stack([(aside.offset * axis).sum(1) for axis in axes])[..., None]
        given = (torch.from_numpy(each).to(dtype) for each in (shares, aside.along, aside.normal))
        told, along, normal = given
        return cls(told, torch.from_numpy(aside.nearest), along, normal)

    def __call__(self, points: Float[Tensor, "*b P 3"]) -> Float[Tensor, "*b N 3"]:
        """The offsets [m] where the line's points are at `points` [m]."""
        now = directions(points)
        before = self.along.expand(now.shape)
        cosine = (before * now).sum(-1, keepdim=True)
        normal = _least_turn(self.normal.expand(now.shape), before, now, cosine)
        across = torch.linalg.cross(now, normal)
        # each point's own least turn, corrected by how much it is rolled against that of the one before
        last = normal[..., :-1, :]
        rolled = torch.atan2((last * across[..., 1:, :]).sum(-1), (last * normal[..., 1:, :]).sum(-1))
        angle = torch.cat([torch.zeros_like(rolled[..., :1]), rolled.cumsum(-1)], -1)
        facing = (0.5 * (1.0 + cosine[..., 0])) ** FACING + LEAST
        angle = angle - (facing * angle).sum(-1, keepdim=True) / facing.sum(-1, keepdim=True)
        angle = angle.unsqueeze(-1)
        normal, across = (
            torch.cos(angle) * normal + torch.sin(angle) * across,
            torch.cos(angle) * across - torch.sin(angle) * normal,
        )
        axes = (each[..., self.nearest, :] for each in (now, normal, across))
        offsets: Tensor = sum(share * axis for share, axis in zip(self.shares, axes, strict=True))
        return offsets


def directions(points: Float[Tensor, "*b P 3"]) -> Float[Tensor, "*b P 3"]:
    """How a line runs at its points; unit vectors."""
    numbers = torch.arange(points.shape[-2])
    ahead, behind = ((numbers + by).clamp(0, len(numbers) - 1) for by in (BESIDE, -BESIDE))
    way = points[..., ahead, :] - points[..., behind, :]
    unit: Tensor = way / way.norm(dim=-1, keepdim=True).clamp_min(1e-12)
    return unit


def _carried(along: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
    """Normals of a line, each as near to the one before as it can be."""
    normal = np.eye(3)[np.abs(along[0]).argmin()]
    normals = []
    for way in along:
        normal = normal - (normal @ way) * way
        normal = normal / max(float(np.linalg.norm(normal)), 1e-12)
        normals.append(normal)
    return np.stack(normals)


def _least_turn(
    vector: Float[Tensor, "*b 3"],
    before: Float[Tensor, "*b 3"],
    now: Float[Tensor, "*b 3"],
    cosine: Float[Tensor, "*b 1"],
) -> Float[Tensor, "*b 3"]:
    """Vectors turned by the least turn that takes one direction to another, whose cosine is given."""
    axis = torch.linalg.cross(before, now)
    lean = (axis * vector).sum(-1, keepdim=True) / (1.0 + cosine).clamp_min(LEAST)
    turned: Tensor = cosine * vector + torch.linalg.cross(axis, vector) + lean * axis
    return turned
