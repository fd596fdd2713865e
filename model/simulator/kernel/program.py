"""A compiled kernel with the graph it runs on, and its runs over a stretch of substeps."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from model.simulator.kernel.call import Buffers, Call, Graphs, Interval, state_rows
from model.simulator.kernel.groups import Acts
from model.simulator.kernel.layout import LANES, Incidence, Layout, Pieces, Slots

HALF = LANES // 2
"""Numbers in the row of a force."""
STORAGE = 192 * 2**20
"""Bytes of states that the adjoint of a frame may hold at once; longer frames are run again in pieces."""


@dataclass(frozen=True)
class Program:
    """What runs, apart from values."""

    library: ctypes.CDLL
    layout: Layout
    pieces: Pieces
    incidence: Incidence | None
    """Of the stencils, where there are any."""
    edges: tuple[Acts, ...]
    """What each constant with one value per edge or stencil belongs to."""
    scenes: tuple[Acts, ...]
    """The same for the constants of the scene."""
    memories: tuple[Acts, ...]
    """The same for the variables of memory."""

    def slots(self, kind: Acts) -> Slots:
        """Of a kind of edge, or of the stencils of a law."""
        if isinstance(kind, int):
            assert self.incidence is not None
            return self.incidence.laws[kind]
        return self.layout.springs if kind == "springs" else self.layout.held

    @cached_property
    def graphs(self) -> Graphs:
        """What is joined to what."""
        return Graphs(self.layout, self.pieces, self.incidence)

    def spread(self, values: Tensor, kind: Acts) -> Tensor:
        """One value per slot from one per edge or stencil, [B, e]."""
        return values.index_select(1, self.slots(kind).edge)


@dataclass(frozen=True)
class Stretch:
    """Some of the substeps of a frame, from a state on."""

    first: int
    steps: int
    rows: Tensor
    """[B, r, 8] at the start, as the engine lays its rows out."""
    memories: tuple[Tensor, ...]
    """[B, slots] at the start."""


@dataclass(frozen=True)
class History:
    """The states of every substep of a stretch, the last one included."""

    first: int
    steps: int
    rows: Tensor
    """[B, steps + 1, r, 8]."""
    memories: tuple[Tensor, ...]
    """[B, steps + 1, slots]."""

    @property
    def start(self) -> Stretch:
        """What it began with."""
        return Stretch(
            self.first, self.steps, self.rows[:, 0], tuple(memory[:, 0] for memory in self.memories)
        )


def first_rows(program: Program, positions: Tensor, velocities: Tensor) -> Tensor:
    """The rows of a state [B, N, 3]; those of controllers are the kernel's to fill."""
    rows = positions.new_zeros(len(positions), state_rows(program.layout), LANES)
    rows[:, : len(program.layout.point)] = point_rows_of(program, positions, velocities)
    return rows


def point_rows_of(program: Program, positions: Tensor, velocities: Tensor) -> Tensor:
    """The rows of points alone, [B, r, 8]."""
    nothing = positions.new_zeros(*positions.shape[:-1], LANES - 6)
    return torch.cat([positions, velocities, nothing], -1).index_select(1, program.layout.point)


def record(program: Program, interval: Interval, values: Buffers, start: Stretch) -> History:
    """Run a stretch and keep everything."""
    rows = _room(start.rows, start.steps + 1)
    memories = tuple(_room(memory, start.steps + 1) for memory in start.memories)
    whole = {"first": start.first, "steps": start.steps, "ring": start.steps + 1, "keep": 1}
    _forward(program, interval, values, rows, memories, whole)()
    return History(start.first, start.steps, rows, memories)


def skip(program: Program, interval: Interval, values: Buffers, start: Stretch) -> Stretch:
    """Run a stretch and keep its end: an empty stretch."""
    rows = _room(start.rows, 2)
    memories = tuple(memory.clone() for memory in start.memories)
    whole = {"first": start.first, "steps": start.steps, "ring": 2, "keep": 0}
    _forward(program, interval, values, rows, memories, whole)()
    return Stretch(start.first + start.steps, 0, rows[:, start.steps % 2], memories)


class Repeated:
    """Frames of one length without gradients: one call, and room that all of them use.

    Args:
        program: What runs.
        interval: Length and number of substeps.
        values: The constants; controllers are given with each frame.
        batch: Elements.
        like: A tensor of the number type.
    """

    def __init__(
        self, program: Program, interval: Interval, values: Buffers, batch: int, like: Tensor
    ) -> None:
        """See the class."""
        self._program, self.interval = program, interval
        layout = program.layout
        self._rows = like.new_zeros(batch, 2, state_rows(layout), LANES)
        self._held = {name: like.new_zeros(batch, layout.controllers, 3) for name in ("before", "after")}
        self._memories = [
            like.new_zeros(batch, program.slots(kind).rows * LANES) for kind in program.memories
        ]
        whole = {"first": 0, "steps": interval.count, "ring": 2, "keep": 0}
        held = Buffers({**values.single, **self._held}, values.lists)
        self._call = _forward(program, interval, held, self._rows, self._memories, whole)

    def __call__(self, inputs: Mapping[str, Tensor], memories: Sequence[Tensor]) -> list[Tensor]:
        """Places, velocities and memories one frame on.

        Args:
            inputs: `positions`, `velocities` [B, N, 3]; `before`, `after` [1 or B, C, 3].
            memories: [1 or B, e].
        """
        layout = self._program.layout
        self._rows[:, 0, : len(layout.point)] = point_rows_of(
            self._program, inputs["positions"], inputs["velocities"]
        )
        for name, room in self._held.items():
            room.copy_(inputs[name])
        for room, memory, kind in zip(self._memories, memories, self._program.memories, strict=True):
            room.copy_(self._program.spread(memory, kind))
        self._call()
        state = self._rows[:, self.interval.count % 2].index_select(1, layout.row)
        after = [
            memory.index_select(1, self._program.slots(kind).place)
            for memory, kind in zip(self._memories, self._program.memories, strict=True)
        ]
        return [state[..., :3].contiguous(), state[..., 3:6].contiguous(), *after]


def storable(program: Program, batch: int, like: Tensor) -> int:
    """How many substeps fit into `STORAGE`."""
    numbers = LANES * state_rows(program.layout)
    numbers += sum(LANES * program.slots(kind).rows for kind in program.memories)
    return max(1, STORAGE // (numbers * batch * like.element_size()) - 1)


def histories(
    program: Program, interval: Interval, values: Buffers, start: Stretch, limit: int
) -> Sequence[Stretch]:
    """A frame in stretches of at most `limit` substeps, about equally long."""
    pieces = -(-start.steps // limit)
    bounds = [start.steps * piece // pieces for piece in range(pieces + 1)]
    made = list[Stretch]()
    now = start
    for piece in range(pieces):
        length = bounds[piece + 1] - bounds[piece]
        made.append(Stretch(bounds[piece], length, now.rows, now.memories))
        if piece + 1 < pieces:
            now = skip(program, interval, values, made[-1])
    return made


def _room(start: Tensor, count: int) -> Tensor:
    """[B, count, …] beginning with `start`."""
    room = start.new_empty(len(start), count, *start.shape[1:])
    room[:, 0] = start
    return room


def _forward(
    program: Program,
    interval: Interval,
    values: Buffers,
    rows: Tensor,
    memories: Sequence[Tensor],
    whole: dict[str, int],
) -> Call:
    nothing = [None] * len(program.edges), [None] * len(program.scenes)
    buffers = Buffers(
        {
            **values.single,
            "rows": rows,
            "sums": piece_rows(program, rows, HALF),
            **corner_rows(program, rows, corner_forces=HALF),
        },
        {
            **values.lists,
            "memory": memories,
            "memory_adjoint": [None] * len(memories),
            "edge_gradient": nothing[0],
            "scene_gradient": nothing[1],
        },
    )
    return Call(program.library, "forward", program.graphs, interval, buffers, whole, len(rows))


def piece_rows(program: Program, like: Tensor, width: int) -> Tensor:
    """Room for what the springs of each piece add at the points that they join."""
    return like.new_zeros(len(like), program.pieces.room * LANES, width)


def corner_rows(program: Program, like: Tensor, **widths: int) -> dict[str, Tensor]:
    """Room for what the corners of stencils hand to their points, of so many numbers each."""
    if program.incidence is None:
        return {}
    return {name: like.new_zeros(len(like), program.incidence.rows, width) for name, width in widths.items()}
