"""Frames of many worlds of one graph, as many of them abreast as a vector of the processor has numbers.

One world at a time, the ends of eight springs are gathered from anywhere and turned into vectors. Of worlds
abreast each number has those of the others beside it.
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import torch
from torch import Tensor

from model.simulator.edges import Edges
from model.simulator.kernel.call import Buffers, Call, Frame, Interval
from model.simulator.kernel.groups import Acts
from model.simulator.kernel.terms import Terms

FULL: Mapping[int, tuple[float, float]] = {8: (0.55, 0.7), 16: (0.3, 0.55)}
"""Shares of so many lanes that must have a world each for it to pay (`benchmarks/simulator/worlds.py`).

The second in graphs of more than `FEW` springs: near caches do not hold what all lanes know of so many.
"""
FEW = 3_000
AXES, STATE = 3, 6


@dataclass(frozen=True)
class Pairs:
    """What is joined to what: by number, in the order that it has."""

    points: int
    controllers: int
    springs: Tensor
    """[E, 2] points."""
    held: Tensor
    """[S, 2] points, and controllers as they follow the points."""
    corners: tuple[Tensor, ...]
    """[k, size] points of each law of stencils."""
    lanes: int
    """Worlds that are abreast."""
    shares = 1

    @classmethod
    def of(cls, edges: Edges, stencils: Sequence[Tensor], lanes: int) -> "Pairs":
        """Of a graph and its stencils."""
        ends = torch.stack([edges.first, edges.second], 1).int()
        springs = edges.spring_count
        return cls(
            edges.point_count,
            edges.node_count - edges.point_count,
            ends[:springs].contiguous(),
            ends[springs:].contiguous(),
            tuple(each.int().contiguous() for each in stencils),
            lanes,
        )

    @cached_property
    def frame(self) -> Frame:
        """A frame with all of it, to be copied; what its pointers lead to lives as long as this."""
        frame = Frame()
        frame.worlds, frame.controllers = self.lanes, self.controllers
        frame.slices = frame.points = self.points
        frame.spring_rows, frame.controller_rows = len(self.springs), len(self.held)
        frame.spring_offset, frame.controller_offset = self.springs.data_ptr(), self.held.data_ptr()
        counts, places = self._stencils
        frame.groups, frame.corners = ctypes.addressof(counts), ctypes.addressof(places)
        return frame

    @cached_property
    def _stencils(self) -> tuple[ctypes.Array[ctypes.c_int64], ctypes.Array[ctypes.c_void_p]]:
        counts, places = (map(len, self.corners), (each.data_ptr() for each in self.corners))
        size = len(self.corners)
        return (ctypes.c_int64 * size)(*counts), (ctypes.c_void_p * size)(*places)


def lanes_of(library: ctypes.CDLL) -> int:
    """How many worlds a kernel moves abreast."""
    lanes: int = library.lanes()
    return lanes


def pays(worlds: int, springs: int, lanes: int) -> bool:
    """Whether so many of so many springs are faster abreast than one after the other.

    On one thread: with more it might be otherwise, but results must not depend on how many there are.
    """
    few, many = FULL[lanes]
    return worlds >= (few if springs <= FEW else many) * _lanes(worlds, lanes).numel()


class Abreast:
    """Frames of one length without gradients, in the same room.

    Args:
        library: The kernel.
        terms: What acts, and the constants.
        interval: Length and number of substeps.
        given: Values of points for substeps of that length, by the name of their input.
    """

    def __init__(
        self, library: ctypes.CDLL, terms: Terms, interval: Interval, given: Mapping[str, Tensor]
    ) -> None:
        """See the class."""
        self.interval, self._worlds = interval, terms.count
        lanes = lanes_of(library)
        self._lanes = _lanes(terms.count, lanes)
        stencils = [s.stencils for s in terms.stencils]
        self._pairs = pairs = Pairs.of(terms.dynamics.system.edges, stencils, lanes)
        groups, like = len(self._lanes), terms.dynamics.mass
        single = {name: self._beside(value) for name, value in given.items()}
        if terms.scenes:
            most = max(len(value) for value in terms.scenes)
            single["scene"] = self._beside(torch.cat([value.expand(most, -1) for value in terms.scenes], -1))
        self._rows = like.new_zeros(groups, pairs.points + pairs.controllers, STATE, lanes)
        self._held = {
            name: like.new_zeros(groups, pairs.controllers, AXES, lanes) for name in ("before", "after")
        }
        sizes: dict[Acts, int] = {"springs": len(pairs.springs), "controllers": len(pairs.held)}
        sizes |= {number: len(corners) for number, corners in enumerate(pairs.corners)}
        self._memories = [like.new_zeros(groups, sizes[kind], lanes) for kind in terms.memory_kinds]
        single |= {
            "rows": self._rows,
            "sums": like.new_zeros(groups, pairs.points, AXES, lanes),
            **self._held,
        }
        lists: dict[str, Sequence[Tensor | None]] = {
            "edge": [self._beside(value) for value in terms.edges],
            "memory": self._memories,
            "memory_adjoint": [None] * len(self._memories),
            "edge_gradient": [None] * len(terms.edges),
            "scene_gradient": [None] * len(terms.scenes),
        }
        whole = {"first": 0, "steps": interval.count, "ring": 1, "keep": 0}
        self._call = Call(library, "abreast", pairs, interval, Buffers(single, lists), whole, groups)

    def __call__(self, inputs: Mapping[str, Tensor], memories: Sequence[Tensor]) -> list[Tensor]:
        """Places, velocities and memories one frame on.

        Args:
            inputs: `positions`, `velocities` [B, N, 3]; `before`, `after` [1 or B, C, 3].
            memories: [1 or B, e].
        """
        points = self._pairs.points
        state = torch.cat([inputs["positions"], inputs["velocities"]], -1)
        self._rows[:, :points] = state[self._lanes].permute(0, 2, 3, 1)
        for name, room in self._held.items():
            places = inputs[name]
            room.copy_(places[self._lanes].permute(0, 2, 3, 1) if len(places) > 1 else places.unsqueeze(-1))
        for room, memory in zip(self._memories, memories, strict=True):
            room.copy_(self._beside(memory))
        self._call()
        after = self._one_by_one(self._rows[:, :points])
        remembered = [self._one_by_one(room) for room in self._memories]
        return [after[..., :AXES].contiguous(), after[..., AXES:].contiguous(), *remembered]

    def _beside(self, value: Tensor) -> Tensor:
        """[B, n] as [groups, n, lanes], or [1, n], which all share, as [1, n, lanes]."""
        value = value.detach()
        if len(value) == 1:
            return value.unsqueeze(-1).expand(-1, -1, self._pairs.lanes).contiguous()
        return value[self._lanes].transpose(1, 2).contiguous()

    def _one_by_one(self, room: Tensor) -> Tensor:
        """[groups, …, lanes] as [B, …]."""
        return room.movedim(-1, 1).flatten(0, 1)[: self._worlds]


@lru_cache(maxsize=16)
def _lanes(worlds: int, lanes: int) -> Tensor:
    """[groups, lanes]: which world each lane has; lanes that are left over have the last one again."""
    groups = -(-worlds // lanes)
    return torch.from_numpy(np.minimum(np.arange(groups * lanes), worlds - 1).reshape(groups, lanes))
