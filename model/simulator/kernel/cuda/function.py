"""A frame of the CUDA kernel as an operation of autograd."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from model.simulator.kernel.call import Interval
from model.simulator.kernel.cuda.frame import Values
from model.simulator.kernel.cuda.program import (
    Program,
    first_rows,
    pieces,
    record,
    retreat,
    skip,
    storable,
)
from model.simulator.kernel.function import NAMED
from model.simulator.kernel.program import History, Stretch


@dataclass(frozen=True)
class Task:
    """What a frame needs besides what gradients flow to."""

    program: Program
    values: Values
    """The constants as the kernel reads them."""
    interval: Interval
    keeps: bool
    """Keep every substep for the adjoint, rather than the state at the start."""


class FrameFunction(torch.autograd.Function):
    """From the state at one frame to that at the next.

    All inputs are [B, …], or [1, …] where the batch shares them: those of `NAMED`, constants per edge, of the
    scene, and memory. The outputs are positions, velocities and memory at the end of the frame.
    """

    @staticmethod
    def forward(ctx: Any, task: Task, *inputs: Tensor) -> tuple[Tensor, ...]:  # noqa: ANN401
        """Run the frame."""
        program, values, start = task.program, _held(task, inputs), _start(task, inputs)
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
        after = [program.gather(memory, k) for memory, k in zip(memories, program.memories, strict=True)]
        return (state[..., :3].contiguous(), state[..., 3:6].contiguous(), *after)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *bars: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401
        """Run the adjoint of the frame, from its end to its start."""
        task, inputs = ctx.task, ctx.saved_tensors
        values, start = _held(task, inputs), _start(task, inputs)
        adjoint = Adjoint(task, values, start, bars, ctx.needs_input_grad[1:])
        if ctx.history is not None:
            adjoint.through(ctx.history)
        else:
            limit = storable(task.program, len(start.rows), start.rows)
            for piece in reversed(pieces(task.program, task.interval, values, start, limit)):
                adjoint.through(record(task.program, task.interval, values, piece))
        shared = [
            None if g is None else g.sum(0, keepdim=True) if len(x) == 1 and len(g) > 1 else g
            for x, g in zip(inputs, adjoint.gradients(), strict=True)
        ]
        return (None, *shared)


def _held(task: Task, inputs: Sequence[Tensor]) -> Values:
    """The constants, with the controllers of this frame."""
    hands = {name: inputs[NAMED.index(name)].contiguous() for name in ("before", "after")}
    return {**task.values, **hands}


def _start(task: Task, inputs: Sequence[Tensor]) -> Stretch:
    program = task.program
    remembered = inputs[len(inputs) - len(program.memories) :]
    memories = tuple(program.spread(m, kind) for m, kind in zip(remembered, program.memories, strict=True))
    return Stretch(0, task.interval.count, first_rows(program, inputs[0], inputs[1]), memories)


class Adjoint:
    """The adjoint of a frame on its way back."""

    def __init__(
        self, task: Task, values: Values, start: Stretch, bars: Sequence[Tensor], needs: Sequence[bool]
    ) -> None:
        """Begin at the end: `bars` are the adjoints of the outputs, `needs` says which inputs want one."""
        self._task, self._values = task, values
        program, like = task.program, start.rows
        batch, points = len(like), program.points
        wants = dict(zip(NAMED, needs, strict=False))

        def room(wanted: bool, *shape: int) -> Tensor | None:
            return like.new_zeros(batch, *shape) if wanted else None

        self._state = torch.cat([bars[0], bars[1]], -1).index_select(1, program.layout.point).contiguous()
        self._memories = [like.new_zeros(memory.shape) for memory in start.memories]
        for memory, bar, kind in zip(self._memories, bars[2:], program.memories, strict=True):
            if isinstance(kind, int):
                memory.copy_(bar)
            else:
                memory[:, program.slots(kind).places] = bar.unsqueeze(1)
        self._points = {name: room(wants[name], points) for name in NAMED[NAMED.index("inverse_mass") :]}
        self._gravity = room(wants["gravity"], points, 3)
        held = program.size("controllers")
        self._held = room(bool(held) and (wants["before"] or wants["after"]), 6, held)
        wanted = iter(needs[len(NAMED) :])
        self._edges = [room(next(wanted), program.size(kind)) for kind in program.edges]
        self._scenes = [
            room(next(wanted), program.size(kind) if isinstance(kind, int) else points)
            for kind in program.scenes
        ]

    def through(self, history: History) -> None:
        """Go back over a stretch."""
        points, like = self._task.program.points, history.rows
        into: Values = {
            **{f"{name}_gradient": value for name, value in self._points.items()},
            "adjoint": self._state,
            "pulls": [like.new_empty(len(like), points, 4) for _ in range(2)],
            "gravity_gradient": self._gravity,
            "held_gradient": self._held,
            "memory_adjoint": self._memories,
            "edge_gradient": self._edges,
            "scene_gradient": self._scenes,
        }
        retreat(self._task.program, self._task.interval, {**self._values, **into}, history)

    def gradients(self) -> list[Tensor | None]:
        """Of every input, in order; None where none is wanted."""
        program = self._task.program
        state = self._state.index_select(1, program.layout.row)
        gravity = None if self._gravity is None else self._gravity.sum(1)
        points = [None if g is None else g.index_select(1, program.layout.row) for g in self._points.values()]
        edges = [
            None if g is None else program.gather(g, kind)
            for g, kind in zip(self._edges, program.edges, strict=True)
        ]
        scenes = [
            # a spring is seen from both of its ends
            None if g is None else g.sum(1, keepdim=True) / (2 if kind == "springs" else 1)
            for g, kind in zip(self._scenes, program.scenes, strict=True)
        ]
        memories = [program.gather(g, k) for g, k in zip(self._memories, program.memories, strict=True)]
        hands = self._hands()
        return [state[..., :3], state[..., 3:], *hands, gravity, *points, *edges, *scenes, *memories]

    def _hands(self) -> tuple[Tensor | None, Tensor | None]:
        """Of where the controllers are at both ends of the frame [B, C, 3]; summed in one order, always."""
        layout = self._task.program.layout
        if self._held is None:
            return None, None
        each = self._held.index_select(2, layout.held.places[0])
        each = torch.cat([each, each.new_zeros(*each.shape[:2], 1)], 2)
        total = each[:, :, layout.holds].sum(-1).transpose(1, 2)
        return total[..., :3], total[..., 3:]
