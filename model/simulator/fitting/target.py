"""What really moved, as a fit sees it."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from model.errors import InputError


@dataclass(frozen=True)
class Target:
    """Observed points, and which mass points they go with.

    Raises:
        InputError: shapes that do not fit each other, an index out of range, or nothing seen at all.
    """

    points: Float[Tensor, "T M 3"]
    """[m]; NaN where not seen."""
    index: Int[Tensor, "K k"] | None = None
    """The mass points that each observed point hangs on; None: the observed points are the mass points."""
    weight: Float[Tensor, "K k"] | None = None
    """Their shares, which sum to 1; None: equal ones."""
    importance: Float[Tensor, "T M"] | None = None
    """How much each sighting counts; None: 1."""
    noise: float = 1e-3
    """Standard deviation of a coordinate [m]: the unit that residuals are measured in."""

    def __post_init__(self) -> None:
        """Check it."""
        if not 0 < self.noise < float("inf"):
            raise InputError(f"noise of the target is {self.noise}: give a length above zero [m]")
        if self.index is not None and len(self.index) != self.points.shape[1]:
            raise InputError(f"{len(self.index)} bindings for {self.points.shape[1]} observed points")
        if self.weight is not None and (self.index is None or self.weight.shape != self.index.shape):
            raise InputError("the weights of the target's bindings need an index of their shape")
        if not bool(self.seen.any()):
            raise InputError("the target has no point that is seen in any frame")

    @property
    def seen(self) -> Bool[Tensor, "T M"]:
        """Where there is something to compare with."""
        seen: Tensor = torch.isfinite(self.points).all(-1)
        return seen if self.importance is None else seen & (self.importance > 0)

    def split(self, heldout: Bool[np.ndarray, " T"]) -> tuple["Target", "Target"]:
        """What is left of it outside, and inside, the held-out frames."""
        held = torch.from_numpy(heldout)[:, None, None]
        nothing = torch.full((), float("nan"), dtype=self.points.dtype)
        return (
            replace(self, points=torch.where(held, nothing, self.points)),
            replace(self, points=torch.where(held, self.points, nothing)),
        )

    def where(self, points: Float[Tensor, "t *b N 3"]) -> Float[Tensor, "t *b M 3"]:
        """Where the observed points would be [m], given the mass points."""
        if self.index is None:
            return points
        corners = points[..., self.index, :]
        if self.weight is None:
            return corners.mean(-2)
        return (corners * self.weight.to(corners).unsqueeze(-1)).sum(-2)

    def residuals(self, points: Float[Tensor, "t *b N 3"]) -> Float[Tensor, "t *b M 3"]:
        """What is seen minus where it would be, in units of noise, zero where not seen; see `loss`."""
        frames = len(points)
        expected = self.where(points)
        shape = (frames, *(1 for _ in points.shape[1:-2]), *self.points.shape[1:])
        seen = self.seen[:frames].reshape(shape[:-1]).unsqueeze(-1)
        scale = seen.to(expected) / self.noise
        if self.importance is not None:
            scale = scale * self.importance[:frames].to(expected).sqrt().reshape(shape[:-1]).unsqueeze(-1)
        there = torch.where(seen, self.points[:frames].to(expected).reshape(shape), 0.0)
        return (there - expected) * scale

    def count(self, frames: int | None = None) -> int:
        """Coordinates seen in the first frames."""
        return 3 * int(self.seen[:frames].sum())

    def error(self, points: Float[Tensor, "t N 3"]) -> float:
        """Mean distance of what is seen from where it would be [m]; NaN where nothing is seen."""
        seen = self.seen[: len(points)]
        apart = (self.points[: len(points)].to(points) - self.where(points))[seen]
        return float(torch.linalg.vector_norm(apart, dim=-1).double().mean()) if len(apart) else float("nan")
