"""A CUDA kernel with the graph it runs on, and its runs over a stretch of substeps."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from model.simulator.kernel.call import Interval
from model.simulator.kernel.cuda.frame import Values, fill, frame_type
from model.simulator.kernel.cuda.layout import Incidence, Layout, Slots
from model.simulator.kernel.cuda.module import Module
from model.simulator.kernel.groups import Acts, Kind
from model.simulator.kernel.program import History, Stretch

ROW = 8
"""Numbers in a row: place, velocity, and what a contact did."""
STORAGE = 2**30
"""Bytes of states that the adjoint of a frame may hold at once; longer frames are run again in pieces."""


@dataclass(frozen=True)
class Program:
    """What runs, apart from values."""

    module: Module
    layout: Layout
    incidence: Incidence | None
    """Of the stencils, where there are any."""
    edges: tuple[Acts, ...]
    """What each constant with one value per edge or stencil belongs to."""
    scenes: tuple[Acts, ...]
    """The same for the constants of the scene."""
    memories: tuple[Acts, ...]
    """The same for the variables of memory."""

    @property
    def points(self) -> int:
        """Of the system."""
        return len(self.layout.row)

    @property
    def stencils(self) -> int:
        """Of all laws."""
        return 0 if self.incidence is None else sum(each.shape[1] for each in self.incidence.corners)

    def slots(self, kind: Kind) -> Slots:
        """Of a kind of edge."""
        return self.layout.springs if kind == "springs" else self.layout.held

    def size(self, kind: Acts) -> int:
        """Slots of a kind of edge, or stencils of a law."""
        if isinstance(kind, int):
            assert self.incidence is not None
            return self.incidence.corners[kind].shape[1]
        return len(self.slots(kind).other)

    def spread(self, values: Tensor, kind: Acts) -> Tensor:
        """One value per slot from one per edge [B, e]; those of stencils stay as they are."""
        return values.contiguous() if isinstance(kind, int) else values.index_select(1, self.slots(kind).edge)

    def gather(self, values: Tensor, kind: Acts) -> Tensor:
        """One value per edge or stencil from one per slot, [B, k]."""
        return values if isinstance(kind, int) else values.index_select(1, self.slots(kind).places[0])

    def frame(self, interval: Interval, values: Values, batch: int) -> ctypes.Structure:
        """What launches are told; `values` must outlive them."""
        laws = () if self.incidence is None else self.incidence.corners
        sizes = len(self.edges), len(self.scenes), len(self.memories), len(laws)
        frame = frame_type(*sizes)()
        frame.points, frame.dt = self.points, interval.dt
        frame.count, frame.interval = interval.count, interval.seconds
        kinds = {"springs": self.layout.springs, "held": self.layout.held}
        if self.incidence is not None:
            kinds["incidence"] = self.incidence.points
            for index, corners in enumerate(laws):
                frame.stencils[index], frame.corners[index] = corners.shape[1], corners.data_ptr()
                frame.corner_row[index] = self.incidence.corner_row[index]
        for name, slots in kinds.items():
            target = getattr(frame, name)
            target.start, target.degree = slots.start.data_ptr(), slots.degree.data_ptr()
            target.other, target.count = slots.other.data_ptr(), len(slots.other)
        fill(frame, values, batch)
        return frame

    def room_for_corners(self, like: Tensor, **widths: int) -> dict[str, Tensor]:
        """Room for what the corners of stencils hand to their points."""
        if self.incidence is None:
            return {}
        count = self.incidence.count
        return {name: like.new_empty(len(like), count, width) for name, width in widths.items()}


def first_rows(program: Program, positions: Tensor, velocities: Tensor) -> Tensor:
    """The rows of a state [B, N, 3]."""
    nothing = positions.new_zeros(*positions.shape[:-1], 2)
    return torch.cat([positions, velocities, nothing], -1).index_select(1, program.layout.point)


def record(program: Program, interval: Interval, values: Values, start: Stretch) -> History:
    """Run a stretch and keep everything."""
    rows = _room(start.rows, start.steps + 1)
    memories = tuple(_room(memory, start.steps + 1) for memory in start.memories)
    _forward(program, interval, {**values, "rows": rows, "memory": memories}, start, keep=True)
    return History(start.first, start.steps, rows, memories)


def skip(program: Program, interval: Interval, values: Values, start: Stretch) -> Stretch:
    """Run a stretch and keep its end: an empty stretch."""
    rows, memories = _room(start.rows, 2), tuple(memory.clone() for memory in start.memories)
    _forward(program, interval, {**values, "rows": rows, "memory": memories}, start, keep=False)
    return Stretch(start.first + start.steps, 0, rows[:, start.steps % 2], memories)


def pieces(
    program: Program, interval: Interval, values: Values, start: Stretch, limit: int
) -> Sequence[Stretch]:
    """A frame in stretches of at most `limit` substeps, about equally long."""
    count = -(-start.steps // limit)
    bounds = [start.steps * piece // count for piece in range(count + 1)]
    made, now = list[Stretch](), start
    for piece in range(count):
        made.append(Stretch(bounds[piece], bounds[piece + 1] - bounds[piece], now.rows, now.memories))
        if piece + 1 < count:
            now = skip(program, interval, values, made[-1])
    return made


def storable(program: Program, batch: int, like: Tensor) -> int:
    """How many substeps fit into `STORAGE`."""
    numbers = ROW * program.points + sum(program.size(kind) for kind in program.memories)
    return max(1, STORAGE // (numbers * batch * like.element_size()) - 1)


def retreat(program: Program, interval: Interval, values: Values, history: History) -> None:
    """The adjoint of a stretch, from its end to its start; `values` holds what it adds to."""
    batch, points, steps = len(history.rows), program.points, history.steps
    room = program.room_for_corners(history.rows, corner_forces=4, corner_adjoints=ROW)
    own: Values = {"rows": history.rows, "memory": history.memories, **room}
    frame = program.frame(interval, {**values, **own}, batch)
    frame.first, frame.ring, frame.keep = history.first, steps + 1, 1
    with program.module.launching() as launch:
        launch("backward_end", points, batch, frame, steps)
        for step in range(steps - 1, -1, -1):
            if program.stencils:
                launch("backward_corners", program.stencils, batch, frame, step)
            launch("backward_points", points, batch, frame, step)


def _forward(program: Program, interval: Interval, values: Values, start: Stretch, keep: bool) -> None:
    batch, points = len(start.rows), program.points
    room = program.room_for_corners(start.rows, corner_forces=4)
    frame = program.frame(interval, {**values, **room}, batch)
    frame.first, frame.ring, frame.keep = start.first, start.steps + 1 if keep else 2, int(keep)
    with program.module.launching() as launch:
        for step in range(start.steps):
            if program.stencils:
                launch("forward_corners", program.stencils, batch, frame, step)
            launch("forward_points", points, batch, frame, step)


def _room(start: Tensor, count: int) -> Tensor:
    """[B, count, …] beginning with `start`."""
    room = start.new_empty(len(start), count, *start.shape[1:])
    room[:, 0] = start
    return room
