"""The spring graph as the kernel reads it: rows of points near each other, and each row's slots."""

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

LANES = 8
"""Points in a slice; numbers in a row."""
WINDOW = 256
"""Rows among which points are sorted by their number of springs: slices fill up, neighbours stay near."""


@dataclass(frozen=True)
class Slots:
    """Where each point's edges of one kind are; a slice's slots come in rows of one per lane."""

    start: Int[Tensor, " s"]
    """First slot row of each slice, and the number of all."""
    offset: Int32[Tensor, " j"]
    """Where the row of a slot's other end begins; for stencils, those of all corners."""
    edge: Int[Tensor, " k"]
    """Which edge of its kind a slot is; 0 for those that only fill a slice up."""
    places: Int[Tensor, "ends e"]
    """The slot of each edge at each end that is a point."""

    @property
    def rows(self) -> int:
        """Slot rows."""
        return len(self.edge) // LANES


@dataclass(frozen=True)
class Layout:
    """Points in rows, and their slots."""

    slices: int
    controllers: int
    row: Int[Tensor, " N"]
    """The row of each point."""
    point: Int[Tensor, " r"]
    """The point of each row; 0 for rows that only fill the last slice up."""
    controller: Int[Tensor, " e"]
    """The controller of each controller spring."""
    springs: Slots
    held: Slots
    """Slots of controller springs, at their points."""

    def partition(self, threads: int) -> Int[Tensor, " t"]:
        """The first slice of each thread, so that all have about as many slots."""
        work = (self.springs.start[1:] + self.held.start[1:]).numpy() + np.arange(1, self.slices + 1)
        goals = work[-1] * np.arange(threads) / threads
        return torch.from_numpy(np.searchsorted(work, goals, side="right").astype(np.int64))


@lru_cache(maxsize=16)
def lay_out(edges: Edges) -> Layout:
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
    slices = -(-count // LANES)
    point = np.zeros(slices * LANES, np.int64)
    point[row] = np.arange(count)
    controller = second[springs:] - count
    return Layout(
        slices,
        edges.node_count - count,
        torch.from_numpy(row),
        torch.from_numpy(point),
        torch.from_numpy(controller),
        _slots(row[own], row[other], 2, slices),
        _slots(row[first[springs:]], controller + slices * LANES, 1, slices),
    )


@dataclass(frozen=True)
class Incidence:
    """Where the corners of stencils are among the points, and the other way round."""

    laws: tuple[Slots, ...]
    """Per law: where each corner's point has its row, and which stencil each lane is."""
    corner_row: Int[Tensor, " l"]
    """The row of each law's first corner; a row of zeros follows the last."""
    rows: int
    """Rows of corners, that of zeros included."""
    points: Slots
    """Per point: the rows of the corners that it is."""


@lru_cache(maxsize=16)
def lay_out_stencils(edges: Edges, forces: tuple[StencilForce, ...]) -> Incidence:
    """The corners of all stencils, in eights: the first corners of eight stencils, then their second, ..."""
    layout = lay_out(edges)
    row = layout.row.numpy()
    laws, begins, own, other, begin = list[Slots](), list[int](), list[np.ndarray](), list[np.ndarray](), 0
    for force in forces:
        stencils = row[force.stencils.cpu().numpy()]
        count, size = stencils.shape
        groups = -(-count // LANES)
        of = np.minimum(np.arange(groups * LANES), count - 1)
        offset = stencils[of].reshape(groups, LANES, size).transpose(0, 2, 1).reshape(-1) * LANES
        laws.append(
            Slots(
                torch.arange(0, groups + 1),
                torch.from_numpy(np.ascontiguousarray(offset, np.int32)),
                torch.from_numpy(of),
                torch.arange(count).unsqueeze(0),
            )
        )
        each, corner = np.divmod(np.arange(count * size), size)
        own.append(stencils.reshape(-1))
        other.append(begin + (each // LANES * size + corner) * LANES + each % LANES)
        begins.append(begin)
        begin += groups * size * LANES
    points = _slots(np.concatenate(own), np.concatenate(other), 1, layout.slices, filler=begin)
    return Incidence(tuple(laws), torch.tensor(begins), begin + 1, points)


def _order(own: np.ndarray, other: np.ndarray, degree: np.ndarray) -> np.ndarray:
    """The row of each point."""
    count = len(degree)
    graph = coo_matrix((np.ones(len(own)), (own, other)), shape=(count, count)).tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
    order = order[np.lexsort((-degree[order], np.arange(count) // WINDOW))]
    row = np.empty(count, np.int64)
    row[order] = np.arange(count)
    return row


def _slots(own: np.ndarray, other: np.ndarray, ends: int, slices: int, filler: int | None = None) -> Slots:
    """Slots from the rows of both ends of each, the edges in order, once for each of their `ends`.

    Slots that only fill a slice up lead to the row `filler`, or from a point to itself.
    """
    order = np.lexsort((other, own))
    degree = np.bincount(own, minlength=slices * LANES)
    deepest = degree.reshape(slices, LANES).max(axis=1)
    start = np.concatenate([[0], np.cumsum(deepest)])
    rank = np.arange(len(own)) - np.repeat(np.cumsum(degree) - degree, degree)
    place = np.empty(len(own), np.int64)
    place[order] = (start[own[order] // LANES] + rank) * LANES + own[order] % LANES
    lanes = np.arange(LANES) + LANES * np.repeat(np.arange(slices), deepest)[:, None]
    offset, of = lanes.reshape(-1).astype(np.int64), np.zeros(lanes.size, np.int64)
    if filler is not None:
        offset[:] = filler
    offset[place], of[place] = other, np.tile(np.arange(len(own) // ends), ends)
    return Slots(
        torch.from_numpy(start.astype(np.int64)),
        torch.from_numpy((offset * LANES).astype(np.int32)),
        torch.from_numpy(of),
        torch.from_numpy(place.reshape(ends, -1)),
    )
