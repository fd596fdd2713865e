"""The spring graph as the CUDA kernel reads it: points near each other in rows, and the slots of each."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Int, Int32
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee
from torch import Tensor

from model.simulator.edges import Edges
from model.simulator.forces.stencil import StencilForce

WARP = 32
"""Points that a processor takes through the same instruction."""
WINDOW = 256
"""Rows among which points are sorted by their number of springs: warps end together, neighbours stay near."""


@dataclass(frozen=True)
class Slots:
    """Where the edges of each point are; the k-th slots of the points of a warp are neighbours."""

    start: Int32[Tensor, " w"]
    """Of each warp of points: where its slots begin, in rows of 32."""
    degree: Int32[Tensor, " r"]
    """Slots of the point in each row."""
    other: Int32[Tensor, " k"]
    """What is at a slot's other end: a row, a controller, or a corner of a stencil."""
    edge: Int[Tensor, " k"]
    """Which edge a slot is; 0 where it is none."""
    places: Int[Tensor, "ends e"]
    """The slot of each edge at each end that is a point."""


@dataclass(frozen=True)
class Layout:
    """Points in rows, and their slots."""

    row: Int[Tensor, " N"]
    """The row of each point."""
    point: Int[Tensor, " N"]
    """The point of each row."""
    springs: Slots
    held: Slots
    """Of controller springs, at their points."""
    holds: Int[Tensor, "C h"]
    """The controller springs of each controller; their number where there is none."""


@dataclass(frozen=True)
class Incidence:
    """Where the corners of stencils are among the points, and the other way round."""

    corners: tuple[Int32[Tensor, "_ _"], ...]
    """Per law: the row of each corner of each stencil, [size, count]."""
    corner_row: tuple[int, ...]
    """Where the corners of each law begin among those of all."""
    count: int
    """Corners of all laws."""
    points: Slots
    """Per point: the corners that it is."""


@lru_cache(maxsize=16)
def lay_out(edges: Edges, device: torch.device) -> Layout:
    """Order the points by reverse Cuthill–McKee, then by degree within windows.

    Reference:
        Kreutzer et al. (2014), A unified sparse matrix data format for efficient general sparse matrix-vector
        multiplication on modern processors with wide SIMD units, SIAM J. Sci. Comput. 36 (SELL-C-σ).
    """
    first, second = edges.first.cpu().numpy(), edges.second.cpu().numpy()
    count, springs = edges.point_count, edges.spring_count
    own = np.concatenate([first[:springs], second[:springs]])
    other = np.concatenate([second[:springs], first[:springs]])
    row = _order(own, other, np.bincount(np.concatenate([own, first[springs:]]), minlength=count))
    controller = second[springs:] - count
    return Layout(
        torch.from_numpy(row).to(device),
        torch.from_numpy(np.argsort(row)).to(device),
        _slots(row[own], row[other], 2, count, device),
        _slots(row[first[springs:]], controller, 1, count, device),
        torch.from_numpy(_lists(controller, edges.node_count - count)).to(device),
    )


@lru_cache(maxsize=16)
def lay_out_stencils(edges: Edges, forces: tuple[StencilForce, ...], device: torch.device) -> Incidence:
    """The corners of all stencils: the first corners of those of a law, then their second, ..."""
    layout = lay_out(edges, device)
    row = layout.row.cpu().numpy()
    corners = [row[force.stencils.cpu().numpy()].T for force in forces]
    begins = np.cumsum([0, *(each.size for each in corners)])
    own = np.concatenate([each.reshape(-1) for each in corners])
    return Incidence(
        tuple(torch.from_numpy(np.ascontiguousarray(each, np.int32)).to(device) for each in corners),
        tuple(int(begin) for begin in begins[:-1]),
        int(begins[-1]),
        _slots(own, np.arange(len(own)), 1, edges.point_count, device),
    )


def _order(own: np.ndarray, other: np.ndarray, degree: np.ndarray) -> np.ndarray:
    """The row of each point."""
    count = len(degree)
    graph = coo_matrix((np.ones(len(own)), (own, other)), shape=(count, count)).tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
    order = order[np.lexsort((-degree[order], np.arange(count) // WINDOW))]
    row = np.empty(count, np.int64)
    row[order] = np.arange(count)
    return row


def _slots(own: np.ndarray, other: np.ndarray, ends: int, count: int, device: torch.device) -> Slots:
    """Slots from the rows of both ends of each, the edges in order, once for each of their `ends`."""
    order = np.lexsort((other, own))
    degree = np.bincount(own, minlength=count)
    warps = -(-count // WARP)
    deepest = np.pad(degree, (0, warps * WARP - count)).reshape(warps, WARP).max(axis=1)
    start = np.concatenate([[0], np.cumsum(deepest)])
    rank = np.arange(len(own)) - np.repeat(np.cumsum(degree) - degree, degree)
    place = np.empty(len(own), np.int64)
    place[order] = (start[own[order] // WARP] + rank) * WARP + own[order] % WARP
    far, of = np.zeros(start[-1] * WARP, np.int32), np.zeros(start[-1] * WARP, np.int64)
    far[place], of[place] = other, np.tile(np.arange(len(own) // ends), ends)
    return Slots(
        torch.from_numpy(start[:-1].astype(np.int32)).to(device),
        torch.from_numpy(degree.astype(np.int32)).to(device),
        torch.from_numpy(far).to(device),
        torch.from_numpy(of).to(device),
        torch.from_numpy(place.reshape(ends, -1)).to(device),
    )


def _lists(owner: np.ndarray, count: int) -> np.ndarray:
    """What each owner has, [count, most]; the number of all where it has no more."""
    degree = np.bincount(owner, minlength=count)
    order = np.argsort(owner, kind="stable")
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(degree) - degree, degree)
    lists = np.full((count, int(degree.max(initial=0))), len(owner), np.int64)
    lists[owner[order], rank] = order
    return lists
