"""Calls into a compiled kernel."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from torch import Tensor

from model.simulator.kernel.layout import LANES, Incidence, Layout, Pieces
from model.simulator.kernel.threads import granted

_P, _L, _D = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class Frame(ctypes.Structure):
    """Mirrors `Frame` in engine/frame.cpp, which says what each field is."""

    _fields_ = (
        *(
            (name, _L)
            for name in ("slices", "controllers", "count", "first", "steps", "ring", "keep", "worlds")
        ),
        *((name, _D) for name in ("dt", "lasts", "interval")),
        ("pieces", _L),
        *((name, _P) for name in ("piece_start", "reach", "origin", "spring_start", "controller_start")),
        *((name, _P) for name in ("spring_offset", "controller_offset")),
        ("spring_rows", _L),
        ("controller_rows", _L),
        *((name, _P) for name in ("groups", "corner_row", "corners", "incidence_start", "incidence_offset")),
        *((name, _P) for name in ("corner_forces", "corner_adjoints")),
        *((name, _P) for name in ("rows", "sums", "before", "after")),
        *((name, _P) for name in ("inverse_mass", "factor", "restitution", "friction", "height", "gravity")),
        *((name, _P) for name in ("edge", "scene", "memory")),
        ("points", _L),
        *((name, _P) for name in ("meeting", "rest", "joined_start", "joined")),
        ("adjoint", _P),
        ("pulls", _P * 2),
        *((name, _P) for name in ("memory_adjoint", "edge_gradient", "scene_gradient")),
        *((name, _P) for name in ("inverse_mass_gradient", "factor_gradient")),
        *((name, _P) for name in ("restitution_gradient", "friction_gradient", "gravity_gradient")),
        ("held_gradient", _P),
    )


_WORD = 8
_WORDS = ctypes.sizeof(Frame) // _WORD
_COLUMN = {name: getattr(Frame, name).offset // _WORD for name, *_ in Frame._fields_}
"""Where each field of a frame is; all are of eight bytes."""


@dataclass(frozen=True)
class Interval:
    """Substeps of one frame."""

    dt: float
    """[s]."""
    count: int
    seconds: float
    """The whole frame [s]."""
    lasts: float | None = None
    """How long a substep is for laws that remember [s]; None: `dt`."""


@dataclass(frozen=True)
class Graphs:
    """What is joined to what."""

    layout: Layout
    pieces: Pieces
    incidence: Incidence | None

    @property
    def shares(self) -> int:
        """In how many one element is divided among threads."""
        return len(self.pieces.origin)

    @cached_property
    def frame(self) -> Frame:
        """A frame with all of it, to be copied; what its pointers lead to lives as long as this."""
        frame, layout, pieces, incidence = Frame(), self.layout, self.pieces, self.incidence
        frame.pieces, frame.piece_start = len(pieces.origin), pieces.start.data_ptr()
        frame.reach, frame.origin = pieces.reach.data_ptr(), pieces.origin.data_ptr()
        frame.slices, frame.controllers, frame.points = layout.slices, layout.controllers, len(layout.row)
        frame.worlds = 1
        for kind, slots in (("spring", layout.springs), ("controller", layout.held)):
            setattr(frame, f"{kind}_start", slots.start.data_ptr())
            setattr(frame, f"{kind}_offset", slots.offset.data_ptr())
            setattr(frame, f"{kind}_rows", slots.rows)
        if incidence is not None:
            groups, corners = self._stencils
            frame.groups, frame.corners = ctypes.addressof(groups), ctypes.addressof(corners)
            frame.corner_row = incidence.corner_row.data_ptr()
            frame.incidence_start = incidence.points.start.data_ptr()
            frame.incidence_offset = incidence.points.offset.data_ptr()
        return frame

    @cached_property
    def _stencils(self) -> tuple[ctypes.Array[ctypes.c_int64], ctypes.Array[ctypes.c_void_p]]:
        """Eights of each law of stencils, and where its corners are."""
        laws = () if self.incidence is None else self.incidence.laws
        counts, places = (law.rows for law in laws), (law.offset.data_ptr() for law in laws)
        return (_L * len(laws))(*counts), (_P * len(laws))(*places)


@dataclass
class Buffers:
    """Contiguous tensors whose first dimension is the batch, of one element where all share it."""

    single: dict[str, Tensor] = field(default_factory=dict)
    """By the field of `Frame`; what is not there is null."""
    lists: dict[str, Sequence[Tensor | None]] = field(default_factory=dict)
    """The same for fields that hold one pointer each per constant or variable."""


@runtime_checkable
class Joined(Protocol):
    """What is joined to what, as frames read it."""

    @property
    def shares(self) -> int:
        """In how many one element is divided among threads."""

    @property
    def frame(self) -> Frame:
        """A frame with all of it, to be copied."""


class Call:
    """A call of `forward`, `backward` or `abreast` of a kernel that may be made again and again.

    It keeps all that its pointers lead to, and reads what is there when it is made.

    Args:
        library: The kernel.
        direction: Which.
        graph: What is joined to what.
        interval: Length and number of substeps.
        buffers: What is read and written.
        whole: `first`, `steps`, `ring` and `keep`.
        batch: Elements.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        direction: str,
        graph: Joined,
        interval: Interval,
        buffers: Buffers,
        whole: Mapping[str, int],
        batch: int,
    ) -> None:
        """See the class."""
        self._run = getattr(library, direction)
        self._batch, self._most = batch, batch if batch > 1 else graph.shares
        self._frames = (Frame * batch)()
        self._alive: list[object] = [graph, buffers]
        self._frames[0] = graph.frame
        first = self._frames[0]
        first.dt, first.count, first.interval = interval.dt, interval.count, interval.seconds
        first.lasts = interval.dt if interval.lasts is None else interval.lasts
        for name, value in whole.items():
            setattr(first, name, value)
        self._point(buffers)

    def __call__(self) -> None:
        """Make it."""
        threads = min(granted(), self._most)
        self._run(self._frames, ctypes.c_int(self._batch), ctypes.c_int(threads))

    def _point(self, buffers: Buffers) -> None:
        """Write where things are, of the first element and how much further on of each next one."""
        words = (_L * _WORDS).from_buffer(self._frames)
        steps = [0] * _WORDS
        for name, tensor in buffers.single.items():
            parts = tensor if name == "pulls" else (tensor,)
            for column, part in enumerate(parts, _COLUMN[name]):
                address, steps[column] = _where(part, self._batch)
                words[column] = address
        for name, tensors in buffers.lists.items():
            places = [_where(tensor, self._batch) for tensor in tensors]
            room = np.array([address for address, _ in places], np.int64)
            if self._batch > 1:
                room = room + np.arange(self._batch)[:, None] * np.array(
                    [step for _, step in places], np.int64
                )
            self._alive.append(room)
            words[_COLUMN[name]] = room.ctypes.data
            steps[_COLUMN[name]] = _WORD * len(places)
        if self._batch > 1:
            table = np.frombuffer(memoryview(self._frames).cast("B"), np.int64).reshape(self._batch, -1)
            table[:] = table[0] + np.arange(self._batch)[:, None] * np.array(steps)


def state_rows(layout: Layout) -> int:
    """Rows of a state: points, then controllers."""
    return point_rows(layout) + layout.controllers


def point_rows(layout: Layout) -> int:
    """Rows of points, those that only fill the last slice up included."""
    return layout.slices * LANES


def _where(tensor: Tensor | None, batch: int) -> tuple[int, int]:
    """Where the first element of a batch begins, and how many bytes further on each next one."""
    if tensor is None or not tensor.numel():
        return 0, 0
    assert tensor.is_contiguous()
    if len(tensor) == 1:
        return tensor.data_ptr(), 0
    assert len(tensor) == batch
    return tensor.data_ptr(), tensor.stride(0) * tensor.element_size()
