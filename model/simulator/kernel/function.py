"""A frame of the kernel as an operation of autograd."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from model.simulator.kernel.call import Buffers, Call, Interval, point_rows
from model.simulator.kernel.groups import Acts
from model.simulator.kernel.layout import LANES
from model.simulator.kernel.program import (
    HALF,
    History,
    Program,
    Stretch,
    corner_rows,
    first_rows,
    histories,
    piece_rows,
    point_rows_of,
    record,
    skip,
    storable,
)

NAMED = (
    "positions",
    "velocities",
    "before",
    "after",
    "gravity",
    "inverse_mass",
    "factor",
    "restitution",
    "friction",
)
"""Inputs of a frame that every kernel has; constants per edge, of the scene and memory follow."""


@dataclass(frozen=True)
class Task:
    """What a frame needs besides what gradients flow to."""

    program: Program
    values: Buffers
    """The constants as the kernel reads them."""
    interval: Interval
    keeps: bool
    """Keep every substep for the adjoint, rather than the state at the start."""


class FrameFunction(torch.autograd.Function):
    """From the state at one frame to that at the next.

    All inputs are [B, …], or [1, …] where the batch shares them; the outputs are positions, velocities and
    memory at the end of the frame.
    """

    @staticmethod
    def forward(ctx: Any, task: Task, *inputs: Tensor) -> tuple[Tensor, ...]:  # noqa: ANN401
        """Run the frame."""
        program, values = task.program, _held(task, inputs)
        start = _start(task, inputs)
        fits = start.steps <= storable(program, len(start.rows), start.rows)
        ctx.task, ctx.history = task, None
        ctx.save_for_backward(*inputs)
        if task.keeps and fits:
            ctx.history = record(program, task.interval, values, start)
            end = ctx.history.rows[:, -1]
            memories = [memory[:, -1] for memory in ctx.history.memories]
        else:
            ended = skip(program, task.interval, values, start)
            end, memories = ended.rows, list(ended.memories)
        state = end.index_select(1, program.layout.row)
        after = [
            memory.index_select(1, program.slots(kind).place)
            for memory, kind in zip(memories, program.memories, strict=True)
        ]
        return (state[..., :3].contiguous(), state[..., 3:6].contiguous(), *after)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401
        """Run the adjoint of the frame, from its end to its start."""
        task, inputs = ctx.task, ctx.saved_tensors
        values, history = _held(task, inputs), ctx.history
        start = _start(task, inputs) if history is None else history.start
        adjoint = Adjoint(task, values, start, bars, ctx.needs_input_grad[1:])
        if history is not None:
            adjoint.through(history)
        else:
            limit = storable(task.program, len(start.rows), start.rows)
            for piece in reversed(histories(task.program, task.interval, values, start, limit)):
                adjoint.through(record(task.program, task.interval, values, piece))
        given = adjoint.gradients()
        shared = [
            None if g is None else g.sum(0, keepdim=True) if len(x) == 1 and len(g) > 1 else g
            for x, g in zip(inputs, given, strict=True)
        ]
        return (None, *shared)


def _held(task: Task, inputs: Sequence[Tensor]) -> Buffers:
    """The constants, with the controllers of this frame."""
    before, after = (inputs[NAMED.index(name)].contiguous() for name in ("before", "after"))
    return Buffers({**task.values.single, "before": before, "after": after}, task.values.lists)


def _start(task: Task, inputs: Sequence[Tensor]) -> Stretch:
    program = task.program
    remembered = inputs[len(inputs) - len(program.memories) :]
    memories = tuple(program.spread(m, kind) for m, kind in zip(remembered, program.memories, strict=True))
    return Stretch(0, task.interval.count, first_rows(program, inputs[0], inputs[1]), memories)


class Adjoint:
    """The adjoint of a frame on its way back."""

    def __init__(
        self, task: Task, values: Buffers, start: Stretch, bars: Sequence[Tensor], needs: Sequence[bool]
    ) -> None:
        """Begin at the end: `bars` are the adjoints of the outputs, `needs` says which inputs want one."""
        self._task, self._values, self._needs = task, values, needs
        program, layout, like = task.program, task.program.layout, start.rows
        self._batch = len(start.rows)
        self._sizes = [len(NAMED), len(program.edges), len(program.scenes), len(program.memories)]
        self._state = point_rows_of(program, bars[0], bars[1])
        self._state[:, len(layout.row) :] = 0.0  # rows that only fill up
        self._pulls = like.new_zeros(2, self._batch, point_rows(layout), HALF)
        self._memories = [like.new_zeros(memory.shape) for memory in start.memories]
        for memory, bar, kind in zip(self._memories, bars[2:], program.memories, strict=True):
            memory[:, program.slots(kind).place] = bar
        make: Callable[..., Tensor] = like.new_zeros
        points = (self._batch, point_rows(layout))
        self._points = {
            name: make(points) if self._wants(name) else None for name in NAMED[NAMED.index("inverse_mass") :]
        }
        self._gravity = make(self._batch, layout.slices, 3, LANES) if self._wants("gravity") else None
        held = self._wants("before") or self._wants("after")
        self._held = make(self._batch, 6, layout.held.rows * LANES) if held and layout.held.rows else None
        wanted = iter(needs[len(NAMED) :])
        self._edges = [
            make(self._batch, program.slots(kind).rows * LANES) if next(wanted) else None
            for kind in program.edges
        ]
        self._scenes = [
            make(self._batch, program.slots(kind).rows * LANES if isinstance(kind, int) else points[1])
            if next(wanted)
            else None
            for kind in program.scenes
        ]

    def _wants(self, name: str) -> bool:
        return self._needs[NAMED.index(name)]

    def through(self, history: History) -> None:
        """Go back over a stretch."""
        single = {f"{name}_gradient": value for name, value in self._points.items() if value is not None}
        single |= {"rows": history.rows, "adjoint": self._state, "pulls": self._pulls}
        single |= {} if self._gravity is None else {"gravity_gradient": self._gravity}
        single |= {} if self._held is None else {"held_gradient": self._held}
        program = self._task.program
        single |= {"sums": piece_rows(program, history.rows, LANES)}
        single |= corner_rows(program, history.rows, corner_adjoints=LANES)
        buffers = Buffers(
            {**self._values.single, **single},
            {
                **self._values.lists,
                "memory": history.memories,
                "memory_adjoint": self._memories,
                "edge_gradient": self._edges,
                "scene_gradient": self._scenes,
            },
        )
        whole = {"first": history.first, "steps": history.steps, "ring": history.steps + 1, "keep": 1}
        Call(program.library, "backward", program.graphs, self._task.interval, buffers, whole, self._batch)()

    def gradients(self) -> list[Tensor | None]:
        """Of every input, in order; None where none is wanted."""
        program, layout = self._task.program, self._task.program.layout
        state = self._state.index_select(1, layout.row)
        before, after = self._controllers()
        gravity = None if self._gravity is None else self._gravity.sum((1, 3))
        points = [None if g is None else g.index_select(1, layout.row) for g in self._points.values()]
        edges = [
            None if g is None else g.index_select(1, program.slots(kind).place)
            for g, kind in zip(self._edges, program.edges, strict=True)
        ]
        scenes = [
            None if g is None else self._total(g, kind)
            for g, kind in zip(self._scenes, program.scenes, strict=True)
        ]
        memories = [
            g.index_select(1, program.slots(kind).place)
            for g, kind in zip(self._memories, program.memories, strict=True)
        ]
        return [state[..., :3], state[..., 3:6], before, after, gravity, *points, *edges, *scenes, *memories]

    def _total(self, gradient: Tensor, kind: Acts) -> Tensor:
        """Of a constant of the scene, from its shares per point or per stencil."""
        if isinstance(kind, int):
            gradient = gradient.index_select(1, self._task.program.slots(kind).place)
        return gradient.sum(1, keepdim=True)

    def _controllers(self) -> tuple[Tensor | None, Tensor | None]:
        """Of where the controllers are at both ends of the frame [B, C, 3]."""
        layout = self._task.program.layout
        if self._held is None:
            return None, None
        each = self._held.index_select(2, layout.held.place)
        total = each.new_zeros(self._batch, 6, layout.controllers).index_add_(2, layout.controller, each)
        total = total.transpose(1, 2)
        return total[..., :3], total[..., 3:]
