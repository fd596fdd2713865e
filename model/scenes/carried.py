"""A finely drawn body follows the points of a case: where its Gaussians are in every frame."""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int32, Int64
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from model.errors import InputError
from model.rotations import matrices
from model.scenes.case import Case
from model.scenes.splats import together
from model.skinning import Skin, bind
from model.types import Array, Gaussians, Topology

FRIENDS = 8
"""Observed points that each observed point is joined to."""
FOLLOWED = 8
"""Observed points that a Gaussian follows."""
SLACK = 1e-3
"""How much is left missing rather than shifting neighbours apart."""


def carried(
    case: Case, gaussians: Gaussians
) -> Iterator[tuple[Float32[Array, "G 3"], Float32[Array, "G 4"], Float32[Array, "G 3 3"]]]:
    """Means [m], quaternions and turns since rest of Gaussians that move as `case.complete` does.

    They are skinned to the observed points, joined along the body, and what is then still missing at those
    points is added, so that an observed point is where the film shows it.

    Raises:
        InputError: the case does not say where its points really were.
    """
    if case.complete is None:
        raise InputError(f"case {case.name}: a film needs to know where all points are in all frames")
    count = len(gaussians)
    springs = along_the_body(case)
    index, weight = bind(gaussians.means, case.rest, k=FOLLOWED, springs=springs)
    own_index, own_weight = bind(case.rest, case.rest, k=index.shape[1], springs=springs)
    handles = Topology(
        points=case.rest,
        mass=np.ones(len(case.rest), np.float32),
        springs=springs.astype(np.int32),
        rest_length=np.linalg.norm(case.rest[springs[:, 0]] - case.rest[springs[:, 1]], axis=1),
        part=np.zeros(len(case.rest), np.int32),
        binding_index=np.concatenate([index, own_index]),
        binding_weight=np.concatenate([weight, own_weight]),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    both = together(gaussians, _dots(case.rest))
    skin = Skin(both, handles)
    laid = matrices(torch.as_tensor(gaussians.quaternions))
    spreading = _spreading(own_index, own_weight)
    for points in case.complete:
        with torch.no_grad():
            means, quaternions = skin(torch.as_tensor(points))
            turns = matrices(quaternions[:count]) @ laid.transpose(1, 2)
        shift = spreading @ (points - means[count:].numpy())
        shifted = means[:count].numpy() + (weight[..., None] * shift[index]).sum(axis=1)
        yield shifted.astype(np.float32), quaternions[:count].numpy(), turns.numpy()


def along_the_body(case: Case) -> Int64[Array, "E 2"]:
    """Pairs of observed points that are near each other along the springs of the case."""
    topology, count = case.topology, len(case.rest)
    points = len(topology.points)
    links = np.stack(
        [np.repeat(np.arange(count), case.anchors.index.shape[1]), case.anchors.index.ravel()], 1
    )
    used = case.anchors.weight.ravel() != 0
    links = links[used]
    length = np.linalg.norm(case.rest[links[:, 0]] - topology.points[links[:, 1]], axis=1)
    rows = np.concatenate([topology.springs[:, 0], points + links[:, 0]])
    columns = np.concatenate([topology.springs[:, 1], links[:, 1]])
    lengths = np.concatenate([topology.rest_length, length]) + 1e-9
    graph = csr_matrix((lengths, (rows, columns)), shape=(points + count,) * 2)
    distance = dijkstra(graph, directed=False, indices=points + np.arange(count))[:, points:]
    nearest = np.argsort(distance, axis=1, kind="stable")[:, 1 : FRIENDS + 1]
    pairs = np.stack([np.repeat(np.arange(count), nearest.shape[1]), nearest.ravel()], axis=1)
    reached = np.isfinite(np.take_along_axis(distance, nearest, axis=1)).ravel()
    return np.unique(np.sort(pairs[reached], axis=1), axis=0).astype(np.int64)


def _spreading(index: Int32[Array, "N k"], weight: Float32[Array, "N k"]) -> Float64[Array, "N N"]:
    """Turns what is missing at the observed points into shifts whose weighted means are what is missing."""
    mean = np.zeros((len(index), len(index)))
    np.add.at(mean, (np.arange(len(index))[:, None], index), weight)
    spreading: Float64[Array, "N N"] = np.linalg.solve(mean.T @ mean + SLACK * np.eye(len(index)), mean.T)
    return spreading


def _dots(points: Float32[Array, "N 3"]) -> Gaussians:
    """Gaussians where observed points are: what is done to the others is done to them."""
    ones = np.ones(len(points), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(points), 1))
    return Gaussians(points, np.ones_like(points), upright, 0.5 * ones, np.ones_like(points), ones)
