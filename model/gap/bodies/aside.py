"""What is seen of a thick rope: places on its skin, beside the middle line that its twin is."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from model.types import Array

LOWEST = 0.1
"""Share of the line below which it lies, if any of it does."""
BESIDE = 2
"""Points of the line, before and behind the nearest one, that say how a rope runs there."""


@dataclass(frozen=True)
class Aside:
    """How far seen places are beside the line in some pose, and how the line runs at each in that pose.

    A chain has no skin. Where it turns, what is seen of its skin turns along, by the least turn that takes
    the way it ran there to the way it runs: nobody sees how a chain is twisted.

    Reference:
        Bishop (1975), There is more than one way to frame a curve, American mathematical monthly 82 (frames
        that turn about the line no more than they must).
    """

    offset: Float64[Array, "N 3"]
    """From the line [m]; 0 of places that are not seen."""
    along: Float64[Array, "N 3"]
    """Direction of the line; unit vectors."""
    ends: Int64[Array, "N 2"]
    """The points of the line by which its direction is told."""

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
        nearest = index[np.arange(len(index)), weight.argmax(1)]
        ends = np.clip(nearest[:, None] + np.array([-BESIDE, BESIDE]), 0, len(points) - 1)
        away = seen - (weight[..., None] * points[index]).sum(1)
        return cls(np.where(np.isfinite(away), away, 0.0), _directions(points, ends), ends)

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
        return replace(self, offset=self.offset @ turn.T, along=self.along @ turn.T)

    def turned(self, points: Float64[Array, "P 3"]) -> Float64[Array, "N 3"]:
        """The offsets in another pose of the line [m]."""
        now = _directions(points, self.ends)
        axis = np.cross(self.along, now)
        cosine = (self.along * now).sum(-1, keepdims=True)
        lean = (axis * self.offset).sum(-1, keepdims=True) / np.maximum(1.0 + cosine, LEAST)
        turned: Float64[Array, "N 3"] = cosine * self.offset + np.cross(axis, self.offset) + lean * axis
        return turned


LEAST = 1e-6
"""Of one and the cosine of a turn: what is turned round has no least turn, and any does."""


def _directions(points: Float64[Array, "P 3"], ends: Int64[Array, "N 2"]) -> Float64[Array, "N 3"]:
    way = points[ends[:, 1]] - points[ends[:, 0]]
    unit: Float64[Array, "N 3"] = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    return unit
