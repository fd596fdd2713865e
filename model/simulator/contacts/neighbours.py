"""Which pairs of points may touch, searched anew only when something has moved far enough."""

import numpy as np
import torch
from jaxtyping import Float, Float64, Int
from scipy.spatial import cKDTree
from torch import Tensor

from model.types import Array

SKIN = 0.3
"""How far beyond the collision distance a search looks, as a share of that distance."""


class NeighbourSearch:
    r"""Pairs of points that are, or may soon be, within a distance of each other.

    A list of pairs within distance + skin stays complete while no point has moved, relative to their mean
    motion, by more than skin / 2: two points within the distance now were then within distance + skin.
    Pairs joined by a spring, and pairs closer than the distance at rest, are never listed.

    Reference:
        Verlet (1967), Computer "experiments" on classical fluids I, Physical Review 159, 98 (neighbour lists
        with a skin).
    """

    def __init__(
        self, rest: Float[Tensor, "N 3"], springs: Int[Tensor, "E 2"], distance: float | Float64[Array, " b"]
    ) -> None:
        """Search for pairs within `distance` [m] of points that rest at `rest` [m], joined by `springs`.

        `distance` may be another one for each element of a batch.
        """
        self.distance = np.atleast_1d(np.asarray(distance, np.float64))
        self._rest = rest.detach().cpu().double().numpy()
        joined = np.sort(springs.detach().cpu().numpy().astype(np.int64), axis=1)
        self._joined = np.unique(joined[:, 0] * len(self._rest) + joined[:, 1])
        self._searched: Tensor | None = None
        self._pairs: tuple[Tensor, Tensor] = (torch.zeros(0), torch.zeros(0))
        self.searches = 0

    @torch.no_grad()
    def pairs(self, positions: Float[Tensor, "*b N 3"]) -> tuple[Int[Tensor, " P"], Int[Tensor, " P"]]:
        """Indices into the points of all batches in a row, first below second, in ascending order."""
        if self._stale(positions):
            clouds = positions.detach().cpu().double().numpy().reshape(-1, *self._rest.shape)
            each = zip(clouds, self._distances(len(clouds)), strict=True)
            found = [self._search(*one) + number * len(self._rest) for number, one in enumerate(each)]
            first, second = torch.from_numpy(np.concatenate(found)).to(positions.device).unbind(1)
            self._pairs = (first.contiguous(), second.contiguous())
            self._searched = positions.detach().clone()
            self.searches += 1
        return self._pairs

    @torch.no_grad()
    def meet(self, before: Float[Tensor, "*b N 3"], after: Float[Tensor, "*b N 3"]) -> bool:
        """Whether any pair comes within the distance while points move straight from `before` to `after`."""
        starts, ends = (
            t.detach().cpu().double().numpy().reshape(-1, *self._rest.shape) for t in (before, after)
        )
        each = zip(starts, ends, self._distances(len(starts)), strict=True)
        return any(self._pass(start, end, distance) for start, end, distance in each)

    def _distances(self, batch: int) -> Float64[Array, " b"]:
        return np.broadcast_to(self.distance, (batch,))

    def _pass(self, start: np.ndarray, end: np.ndarray, distance: float) -> bool:
        if not (np.isfinite(start).all() and np.isfinite(end).all()):
            return False  # the rollout is about to say so
        travel = end - start
        own = np.linalg.norm(travel - travel.mean(axis=0), axis=1).max()
        first, second = self._listed(cKDTree(start), distance + 2 * own, distance).T
        apart, closing = start[second] - start[first], travel[second] - travel[first]
        speed = np.einsum("ij,ij->i", closing, closing)
        nearest = -np.einsum("ij,ij->i", apart, closing) / np.maximum(speed, 1e-30)
        apart = apart + nearest.clip(0.0, 1.0)[:, None] * closing
        return bool((np.einsum("ij,ij->i", apart, apart) < distance**2).any())

    def _stale(self, positions: Tensor) -> bool:
        if self._searched is None or self._searched.shape != positions.shape:
            return True
        moved = positions - self._searched.to(positions)
        own = torch.linalg.vector_norm(moved - moved.mean(-2, keepdim=True), dim=-1)
        farthest = own.amax(-1).reshape(-1).cpu().double().numpy()
        return not (farthest <= SKIN / 2 * self.distance).all()

    def _search(self, cloud: np.ndarray, distance: float) -> np.ndarray:
        if not np.isfinite(cloud).all():
            return np.zeros((0, 2), np.int64)  # the rollout is about to say so
        return self._listed(cKDTree(cloud), (1 + SKIN) * distance, distance)

    def _listed(self, tree: cKDTree, reach: float, distance: float) -> np.ndarray:
        """Pairs within `reach` [m] that may collide at all."""
        pairs = tree.query_pairs(reach, output_type="ndarray").astype(np.int64)
        apart = self._rest[pairs[:, 0]] - self._rest[pairs[:, 1]]
        far = np.einsum("ij,ij->i", apart, apart) >= distance**2
        pairs = pairs[far]
        keys = np.sort(pairs[:, 0] * len(self._rest) + pairs[:, 1])
        keys = keys[~np.isin(keys, self._joined, assume_unique=True)]
        return np.stack([keys // len(self._rest), keys % len(self._rest)], axis=1)
