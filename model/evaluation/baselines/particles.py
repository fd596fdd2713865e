"""A few of the mass points as particles of a graph, and where they were while the object was seen."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Int
from scipy.spatial import cKDTree
from torch import Tensor

from model.scenes.anchors import anchor
from model.scenes.case import Anchors, Case
from model.types import Array

FOLLOWED = 8
"""Sightings that say where a particle is."""


@dataclass(frozen=True)
class Particles:
    """A graph over a case: particles, then controllers."""

    rest: Float[Tensor, "n 3"]
    """Of particles and controllers in frame 0 [m]."""
    count: int
    """Particles; the rest are controllers."""
    pairs: Int[Tensor, "e 2"]
    """(sender, receiver): near particles both ways, and from controllers to what they hold."""
    spacing: float
    """Usual distance of neighbours [m]."""
    anchors: Anchors
    """How observed points follow the particles."""
    ground: float | None
    """z of the ground [m]."""


def choose(case: Case, most: int) -> Int[Array, " n"]:
    """Mass points spread evenly over the object, `most` of them or all; the same for all its interactions."""
    points = case.topology.points.astype(np.float64)
    chosen = [int(((points - points.mean(axis=0)) ** 2).sum(axis=1).argmax())]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < min(most, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def graph(case: Case, chosen: Int[Array, " n"], neighbours: int) -> Particles:
    """Join each particle to its nearest, and each controller that holds something to those nearest to it."""
    points = case.topology.points[chosen]
    tree, count = cKDTree(points), len(points)
    wanted = min(neighbours + 1, count)
    distance, index = tree.query(points, wanted)
    distance, index = distance.reshape(count, wanted), index.reshape(count, wanted)
    own = np.stack([np.repeat(np.arange(count), wanted), index.ravel()], axis=1)
    own = np.unique(np.sort(own[own[:, 0] != own[:, 1]], axis=1), axis=0)
    held = case.topology.controller_points
    most = min(neighbours, count)
    near = tree.query(held, most)[1].reshape(len(held), most)
    grips = np.stack([count + np.repeat(np.arange(len(held)), most), near.ravel().astype(np.int64)], axis=1)
    grips = grips[np.isin(grips[:, 0] - count, case.topology.controller_springs[:, 0])]
    pairs = np.concatenate([own, own[:, ::-1], grips])
    return Particles(
        rest=torch.as_tensor(np.concatenate([points, held])),
        count=count,
        pairs=torch.as_tensor(np.ascontiguousarray(pairs)).long(),
        spacing=float(np.median(distance[:, 1:])),
        anchors=anchor(case.rest, points, own),
        ground=case.observation.ground_height,
    )


def followed(case: Case, rest: Float32[Array, "n 3"]) -> Float32[Array, "F n 3"]:
    """Where particles were before the split [m]: moved as the nearest points that were seen, at rest.

    A frame in which nothing was seen repeats the one before.
    """
    tracks = np.repeat(rest[None], case.split, axis=0)
    for frame in range(1, case.split):
        there = np.isfinite(case.observation.points[frame]).all(axis=1)
        if not there.any():
            tracks[frame] = tracks[frame - 1]
            continue
        moved = case.observation.points[frame][there] - case.rest[there]
        wanted = min(FOLLOWED, len(moved))
        distance, index = cKDTree(case.rest[there]).query(rest, wanted)
        distance, index = distance.reshape(-1, wanted), index.reshape(-1, wanted)
        weight = 1.0 / (distance + 1e-3 * distance[:, -1:] + 1e-9)
        weight /= weight.sum(axis=1, keepdims=True)
        tracks[frame] = rest + np.einsum("nk,nkc->nc", weight, moved[index])
    return tracks
