"""Gaussians follow the points: who follows whom, and where that takes them."""

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int32, Integer
from scipy.sparse import csr_matrix, identity
from scipy.spatial import cKDTree
from torch import Tensor, nn

from model.rotations import matrices, multiply, nearest_rotations
from model.types import Array, Gaussians, Topology

HOPS = 2
"""How far along the springs, from the nearest point, a Gaussian may look for points to follow."""
NEIGHBOURS = 16
"""Points that say how the surroundings of a point have turned."""
NEARBY, WHOLE = 0.1, 1e-3
"""How much the neighbours' surroundings and the object's turn as a whole count beside a point's own
surroundings: enough to settle what a straight rope or a single spring leaves open, too little to
be seen elsewhere."""
UNTURNED = 1e-5
"""How much the rest state counts in the object's turn as a whole."""


def bind(
    gaussian_means: Float32[Array, "G 3"],
    points: Float32[Array, "N 3"],
    k: int = 8,
    springs: Integer[Array, "E 2"] | None = None,
) -> tuple[Int32[Array, "G k"], Float32[Array, "G k"]]:
    """Choose the points that each Gaussian follows, and how much it follows each.

    Weights fall off with the distance as a Gaussian as wide as half the mean distance of the k points.
    With springs given, only points within a few springs of the nearest one count, so that
    nothing is bound across a gap; where fewer than k remain, the rest have no weight.

    Args:
        gaussian_means: Centres [m].
        points: Rest positions [m].
        k: Points per Gaussian; all the points where there are fewer.
        springs: Pairs of points.

    Returns:
        Indices of points, nearest first, and weights, whose rows sum to 1.
    """
    k = min(k, len(points))
    candidates = k if springs is None else min(4 * k, len(points))
    distance, index = cKDTree(points).query(gaussian_means, k=candidates)
    distance, index = distance.reshape(-1, candidates), index.reshape(-1, candidates)
    if springs is not None:
        connected = _within_hops(index, springs, len(points))
        distance = np.where(connected, distance, np.inf)
        nearest_first = np.argsort(distance, axis=1, kind="stable")[:, :k]
        distance = np.take_along_axis(distance, nearest_first, axis=1)
        index = np.take_along_axis(index, nearest_first, axis=1)
    missing = ~np.isfinite(distance)
    index = np.where(missing, index[:, :1], index)
    width = np.mean(distance, axis=1, where=~missing, keepdims=True) / 2 + 1e-9
    # Relative to the nearest, so that a Gaussian far from all points still follows something.
    exponent = (distance[:, :1] ** 2 - np.where(missing, np.inf, distance) ** 2) / (2 * width**2)
    weight = np.exp(exponent)
    weight = (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)
    return index.astype(np.int32), weight


def _within_hops(
    index: Integer[Array, "G m"], springs: Integer[Array, "E 2"], point_count: int
) -> Bool[Array, "G m"]:
    """Whether a point can be reached from the first of its row along at most `HOPS` springs."""
    ones = np.ones(len(springs), np.float32)
    graph = csr_matrix((ones, (springs[:, 0], springs[:, 1])), shape=(point_count, point_count))
    step = graph + graph.T + identity(point_count, format="csr", dtype=np.float32)
    reach = step
    for _ in range(HOPS - 1):
        reach = reach @ step
    first = np.repeat(index[:, 0], index.shape[1])
    connected: Bool[Array, "G m"] = (np.asarray(reach[first, index.ravel()]) > 0).reshape(index.shape)
    return connected


class Skin(nn.Module):
    r"""Carries Gaussians along with the points they are bound to.

    Every point gets the rotation that best explains how its neighbours have moved about it; a
    Gaussian at $\mu$ moves to $\sum_j w_j (x_j + R_j (\mu - X_j))$ and turns with the blended
    rotation. Rigid motion is reproduced exactly, and the rest state is left as it is.
    The scales do not change: the springs' strain is small, and its noise would flicker.

    Args:
        gaussians: At rest.
        topology: Points at rest, springs and bindings.

    Reference:
        Sumner et al. (2007), Embedded deformation for shape manipulation, eq. 1;
        Horn (1987), Closed-form solution of absolute orientation using unit quaternions.
    """

    def __init__(self, gaussians: Gaussians, topology: Topology) -> None:
        """Find every point's neighbours and what they look like at rest."""
        super().__init__()
        rest = torch.as_tensor(topology.points, dtype=torch.float64)
        neighbours, weights = spring_neighbours(topology.points, topology.springs)
        self.register_buffer("neighbours", torch.as_tensor(neighbours, dtype=torch.int64))
        offsets = rest[self.neighbours] - rest[:, None]
        spread = weights[..., None] * offsets
        # A point's neighbours weigh 1 together, in the unit of their squared distances.
        scale = (spread * offsets).sum(dim=(1, 2)).clamp_min(1e-18)
        self.register_buffer("pull", (spread / scale[:, None, None]).float())
        self.register_buffer("center", rest.mean(dim=0).float())
        around = rest - rest.mean(dim=0)
        self.register_buffer("around", (around / around.square().sum().clamp_min(1e-18)).float())
        self.register_buffer("rest", (rest - rest.mean(dim=0)).float())
        self.register_buffer("means", torch.as_tensor(gaussians.means) - self.center)
        self.register_buffer("quaternions", torch.as_tensor(gaussians.quaternions))
        self.register_buffer("index", torch.as_tensor(topology.binding_index, dtype=torch.int64))
        self.register_buffer("weight", torch.as_tensor(topology.binding_weight))

    neighbours: Tensor
    pull: Tensor
    center: Tensor
    around: Tensor
    rest: Tensor
    means: Tensor
    quaternions: Tensor
    index: Tensor
    weight: Tensor

    def forward(self, points: Float[Tensor, "N 3"]) -> tuple[Float[Tensor, "G 3"], Float[Tensor, "G 4"]]:
        """Means [m] and unit quaternions of the Gaussians when the points are at `points` [m]."""
        turns = self.rotations(points)
        rotation = matrices(turns)
        shift = points - (rotation @ self.rest[..., None]).squeeze(-1)
        motion = torch.cat([rotation.flatten(1), shift], dim=1)
        blended = nn.functional.embedding_bag(
            self.index, motion, per_sample_weights=self.weight.to(motion), mode="sum"
        )
        means = (blended[:, :9].view(-1, 3, 3) @ self.means[..., None]).squeeze(-1) + blended[:, 9:]
        bound = turns[self.index]
        same_side = torch.where((bound * bound[:, :1]).sum(dim=2) < 0, -self.weight, self.weight)
        turn = nn.functional.normalize((same_side[..., None] * bound).sum(dim=1), dim=1)
        return means, multiply(turn, self.quaternions)

    def rotations(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 4"]:
        """How the surroundings of each point have turned since rest, as unit quaternions."""
        own = (points[self.neighbours] - points[:, None]).transpose(1, 2) @ self.pull
        nearby = own.flatten(1)[self.neighbours].mean(dim=1).view(-1, 3, 3)
        # In double precision, with a trace of the rest state: it decides how a straight line has twisted.
        spread = (points - points.mean(dim=0)).double().T @ self.around.double()
        unturned = UNTURNED * torch.eye(3, dtype=spread.dtype, device=spread.device)
        whole = matrices(nearest_rotations((spread + unturned)[None])).to(points)
        return nearest_rotations(own + NEARBY * nearby + WHOLE * whole)


def spring_neighbours(
    points: Float32[Array, "N 3"], springs: Integer[Array, "E 2"]
) -> tuple[Integer[Array, "N m"], Float[Tensor, "N m"]]:
    """The points nearest to each point along the springs, and equal weights; 0 where there are fewer."""
    both = np.concatenate([springs, springs[:, ::-1]]).astype(np.int64)
    length = np.linalg.norm(points[both[:, 0]] - points[both[:, 1]], axis=1)
    both = both[np.lexsort((both[:, 1], length, both[:, 0]))]
    count = np.bincount(both[:, 0], minlength=len(points))
    place = np.arange(len(both)) - (np.cumsum(count) - count)[both[:, 0]]
    kept = place < NEIGHBOURS
    neighbours = np.tile(np.arange(len(points))[:, None], (1, NEIGHBOURS))
    weights = np.zeros((len(points), NEIGHBOURS))
    neighbours[both[kept, 0], place[kept]] = both[kept, 1]
    weights[both[kept, 0], place[kept]] = 1.0
    return neighbours, torch.as_tensor(weights)
