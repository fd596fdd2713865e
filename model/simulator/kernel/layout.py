"""The spring graph as the kernel reads it: rows of points near each other, and each row's slots."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import isqrt

import numpy as np
import torch
from jaxtyping import Int, Int32
from torch import Tensor

from model.simulator.edges import Edges
from model.simulator.forces.stencil import StencilForce
from model.simulator.kernel.arrange import levelled, near, owners

LANES = 8
"""Points in a slice; numbers in a row."""
PIECE = 650
"""A graph of n² times as many slot rows has n pieces: of more pieces, more points would lie in several."""


@dataclass(frozen=True)
class Slots:
    """Where edges of one kind are, each at one of its points; slots come in rows of one per lane."""

    start: Int[Tensor, " s"]
    """First slot row of each slice, and the number of all."""
    offset: Int32[Tensor, " j"]
    """Where the row of a slot's other end begins; for stencils, those of all corners."""
    edge: Int[Tensor, " k"]
    """Which edge of its kind a slot is; 0 for those that only fill a slice up."""
    place: Int[Tensor, " e"]
    """The slot of each edge."""

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


@dataclass(frozen=True)
class Pieces:
    """Shares of the slices, of about equally many slots, for threads to take."""

    start: Int[Tensor, " p"]
    """First slice of each, and the number of all."""
    reach: Int[Tensor, "pieces 2"]
    """From which slice to before which one the points lie that are joined to those of a piece."""
    origin: Int[Tensor, " pieces"]
    """Where the piece's own sums for those slices would begin if they began with slice 0, in slices."""
    room: int
    """Slices that have room in the sums of all pieces."""


@dataclass(frozen=True)
class Ends:
    """Which nodes each edge joins, as what a cache looks up: worlds of the same graph are laid out once."""

    first: bytes
    second: bytes
    points: int
    nodes: int
    springs: int

    @classmethod
    def of(cls, edges: Edges) -> "Ends":
        """Of a graph."""
        first, second = (ends.cpu().numpy().tobytes() for ends in (edges.first, edges.second))
        return cls(first, second, edges.point_count, edges.node_count, edges.spring_count)


def lay_out(edges: Edges) -> Layout:
    """Order the points so that neighbours are near, and give every edge its slot."""
    return _laid_out(Ends.of(edges))


@lru_cache(maxsize=16)
def _laid_out(ends: Ends) -> Layout:
    first, second = (np.frombuffer(nodes, np.int64) for nodes in (ends.first, ends.second))
    count, springs = ends.points, ends.springs
    pairs = np.stack([first[:springs], second[:springs]])
    owner, each = owners(pairs, count), np.arange(springs)
    order = levelled(near(pairs, count), np.bincount(pairs[owner, each], minlength=count))
    row = np.empty(count, np.int64)
    row[order] = np.arange(count)
    slices = -(-count // LANES)
    point = np.zeros(slices * LANES, np.int64)
    point[row] = np.arange(count)
    controller = second[springs:] - count
    return Layout(
        slices,
        ends.nodes - count,
        torch.from_numpy(row),
        torch.from_numpy(point),
        torch.from_numpy(controller),
        _slots(row[pairs[owner, each]], row[pairs[1 - owner, each]], slices),
        _slots(row[first[springs:]], controller + slices * LANES, slices),
    )


def cut(edges: Edges) -> Pieces:
    """Cut the slices in pieces. How many does not depend on the machine, so sums do not either."""
    return _cut(Ends.of(edges), PIECE)


@lru_cache(maxsize=16)
def _cut(ends: Ends, piece: int) -> Pieces:
    layout = _laid_out(ends)
    springs = layout.springs
    count = max(1, isqrt(springs.rows // piece))
    work = (springs.start[1:] + layout.held.start[1:]).numpy() + np.arange(1, layout.slices + 1)
    start = np.searchsorted(work, work[-1] * np.arange(count + 1) / count).astype(np.int64)
    start[0], start[-1] = 0, layout.slices
    seen = springs.offset.numpy().reshape(-1, LANES) // (LANES * LANES)
    reach = np.empty((count, 2), np.int64)
    for number, (begin, end) in enumerate(pairwise(start)):
        there = seen[springs.start[begin] : springs.start[end]]
        reach[number] = min(begin, there.min(initial=begin)), max(end, there.max(initial=begin) + 1)
    sizes = reach[:, 1] - reach[:, 0]
    origin = np.cumsum(sizes) - sizes - reach[:, 0]
    return Pieces(
        torch.from_numpy(start), torch.from_numpy(reach), torch.from_numpy(origin), int(sizes.sum())
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


def lay_out_stencils(edges: Edges, forces: tuple[StencilForce, ...]) -> Incidence:
    """The corners of all stencils, in eights: the first corners of eight stencils, then their second, ..."""
    groups = tuple((force.stencils.cpu().numpy().tobytes(), force.size) for force in forces)
    return _laid_out_stencils(Ends.of(edges), groups)


@lru_cache(maxsize=16)
def _laid_out_stencils(ends: Ends, forces: tuple[tuple[bytes, int], ...]) -> Incidence:
    layout = _laid_out(ends)
    row = layout.row.numpy()
    laws, begins, own, other, begin = list[Slots](), list[int](), list[np.ndarray](), list[np.ndarray](), 0
    for indices, size in forces:
        stencils = row[np.frombuffer(indices, np.int64).reshape(-1, size)]
        count = len(stencils)
        groups = -(-count // LANES)
        of = np.minimum(np.arange(groups * LANES), count - 1)
        offset = stencils[of].reshape(groups, LANES, size).transpose(0, 2, 1).reshape(-1) * LANES
        laws.append(
            Slots(
                torch.arange(0, groups + 1),
                torch.from_numpy(np.ascontiguousarray(offset, np.int32)),
                torch.from_numpy(of),
                torch.arange(count),
            )
        )
        each, corner = np.divmod(np.arange(count * size), size)
        own.append(stencils.reshape(-1))
        other.append(begin + (each // LANES * size + corner) * LANES + each % LANES)
        begins.append(begin)
        begin += groups * size * LANES
    points = _slots(np.concatenate(own), np.concatenate(other), layout.slices, filler=begin)
    return Incidence(tuple(laws), torch.tensor(begins), begin + 1, points)


def _slots(own: np.ndarray, other: np.ndarray, slices: int, filler: int | None = None) -> Slots:
    """Slots from the rows of both ends of each edge, at its `own`.

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
    offset[place], of[place] = other, np.arange(len(own))
    return Slots(
        torch.from_numpy(start.astype(np.int64)),
        torch.from_numpy((offset * LANES).astype(np.int32)),
        torch.from_numpy(of),
        torch.from_numpy(place),
    )
