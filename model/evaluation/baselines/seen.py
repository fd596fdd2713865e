"""What of a case may be learned from, and how far a motion is from it."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor

from model.errors import InputError
from model.scenes.case import Case
from model.types import Array

MILLIMETRE = 1e-3
"""Unit of the loss: its square is of the order of one for a fit that is as good as the tracks [m]."""


def last_seen(case: Case) -> Float32[Array, "N 3"]:
    """Where each observed point was last seen before the split [m]; never seen: where it was at rest."""
    shape = case.rest.copy()
    for points in case.observation.points[: case.split]:
        there = np.isfinite(points).all(axis=1)
        shape[there] = points[there]
    return shape


def across(offset: Float[Tensor, "*f N 3"], sight: Float[Tensor, "*f N 3"] | None) -> Float[Tensor, "*f N 3"]:
    """What of an offset [m] was measured: all of it, or with one camera what is across its lines of sight."""
    return offset if sight is None else offset - (offset * sight).sum(-1, keepdim=True) * sight


@dataclass(frozen=True)
class Seen:
    """The frames [0, split) of a case, for a loss."""

    points: Float[Tensor, "F N 3"]
    """[m]; where they are not seen, anything finite."""
    there: Bool[Tensor, "F N"]
    """Which are seen."""
    sight: Float[Tensor, "F N 3"] | None
    """Directions from the camera; None: points were measured in space."""

    @classmethod
    def of(cls, case: Case) -> "Seen":
        """What of `case` may be learned from.

        Raises:
            InputError: nothing is seen after the first frame and before the split.
        """
        points = torch.as_tensor(case.observation.points[: case.split])
        there = torch.isfinite(points).all(-1)
        if not bool(there[1:].any()):
            raise InputError(
                f"case {case.name}: no point is seen in frames 1 to {case.split - 1}: nothing to fit"
            )
        points = torch.where(there.unsqueeze(-1), points, torch.as_tensor(case.rest))
        sight = None
        if case.camera is not None:
            rays = points - torch.as_tensor(case.camera.position.astype(np.float32))
            sight = rays / torch.linalg.vector_norm(rays, dim=-1, keepdim=True).clamp_min(1e-9)
        return cls(points, there, sight)

    def __len__(self) -> int:
        """Frames."""
        return len(self.points)

    def loss(self, predicted: Float[Tensor, "f N 3"], chamfer: float = 1.0) -> Float[Tensor, ""]:
        """Track and Chamfer loss of the first f frames, frame 0 apart [mm²].

        Track: half the mean square of coordinates of the points that are seen (PhysTwin's smooth-L1, which is
        quadratic below a metre). Chamfer: the mean square distance of what is seen from the nearest predicted
        point.

        Reference:
            Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable
            objects from videos, arXiv:2503.17973 (both losses, each with weight 1).
        """
        frames = len(predicted)
        there = self.there[1:frames]
        sight = None if self.sight is None else self.sight[1:frames]
        count = there.sum().clamp_min(1)
        seen, made = self.points[1:frames], predicted[1:]
        squares = across(made - seen, sight).square().sum(-1)
        total = torch.where(there, squares, 0.0).sum() / (6.0 * count)
        if chamfer:
            nearest = made.gather(1, self._nearest(made).unsqueeze(-1).expand(-1, -1, 3))
            apart = across(nearest - seen, sight).square().sum(-1)
            total = total + chamfer * torch.where(there, apart, 0.0).sum() / count
        return total / MILLIMETRE**2

    def _nearest(self, made: Float[Tensor, "f N 3"]) -> Tensor:
        """The predicted point nearest to each one that is seen, frame by frame."""
        with torch.no_grad():
            nearest: Tensor = torch.cdist(self.points[1 : 1 + len(made)], made.detach()).argmin(-1)
        return nearest
