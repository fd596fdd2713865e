"""Where on the body a hand holds it, and how that fades with the distance from the hand."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from model.gap.bodies.grip import holding
from model.types import Array


@dataclass(frozen=True)
class Hold:
    """Points that a hand may hold, as its controllers lie to them in the first frame.

    A few controllers lie anywhere within their hand, and a lattice has points where it happens to have them:
    both say only within a spacing or so where on the body a hand holds it, which decides how far the body
    turns under its own weight. So that can be moved, too.
    """

    offsets: Float64[Array, "H C 3"]
    """From each controller to each point [m]; infinite for controllers of another hand."""
    hands: Int64[Array, " H"]
    """Which hand holds each point, counted from 0."""

    @classmethod
    def of(cls, controllers: Float64[Array, "C 3"], points: Float64[Array, "H 3"], apart: float) -> "Hold":
        """Each point is held by the hand of the nearest controller.

        Args:
            controllers: In the first frame [m].
            points: Held points in the first frame [m].
            apart: Controllers farther than this from all others of a hand belong to another [m].
        """
        offsets = points[:, None] - controllers[None]
        if not len(points):
            return cls(offsets, np.zeros(0, np.int64))
        hands, nearest = holding(controllers, points, apart)
        offsets[nearest[:, None] != hands] = np.inf
        return cls(offsets, np.unique(nearest, return_inverse=True)[1].astype(np.int64))

    def square(self, moved: Float[Tensor, "*b n 3"] | None = None) -> Float[Tensor, "*b H"]:
        """Squared distance of each point from its hand [m²], less that of the point which is nearest to it.

        What counts is exp(-d²/2r²) over that of the nearest point: a hand holds something, wherever a lattice
        happens to have points.

        Args:
            moved: How far each hand is from its controllers on the body [m]; None: it is where they are.
        """
        if not len(self.hands):
            return torch.zeros(0, dtype=torch.float64)
        offsets = torch.from_numpy(self.offsets)
        if moved is not None:
            offsets = offsets - moved[..., self.hands, None, :]
        square: Tensor = offsets.square().sum(-1).amin(-1)
        hands = torch.from_numpy(self.hands).expand(square.shape)
        nearest = square.new_full((*square.shape[:-1], int(self.hands.max()) + 1), torch.inf)
        return square - nearest.scatter_reduce(-1, hands, square, "amin").gather(-1, hands)
