"""Calls into a compiled kernel."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from model.simulator.kernel.layout import LANES, Incidence, Layout, Pieces

_P, _L, _D = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


class Frame(ctypes.Structure):
    """Mirrors `Frame` in engine/frame.cpp, which says what each field is."""

    _fields_ = (
        *((name, _L) for name in ("slices", "controllers", "count", "first", "steps", "ring", "keep")),
        ("dt", _D),
        ("interval", _D),
        ("pieces", _L),
        *((name, _P) for name in ("piece_start", "reach", "origin", "spring_start", "controller_start")),
        *((name, _P) for name in ("spring_offset", "controller_offset")),
        ("spring_rows", _L),
        ("controller_rows", _L),
        *((name, _P) for name in ("groups", "corner_row", "corners", "incidence_start", "incidence_offset")),
        *((name, _P) for name in ("corner_forces", "corner_adjoints")),
        *((name, _P) for name in ("rows", "sums", "before", "after")),
        *((name, _P) for name in ("inverse_mass", "factor", "restitution", "friction", "height", "gravity")),
        *((name, _P) for name in ("edge", "scene", "memory", "adjoint")),
        ("pulls", _P * 2),
        *((name, _P) for name in ("memory_adjoint", "edge_gradient", "scene_gradient")),
        *((name, _P) for name in ("inverse_mass_gradient", "factor_gradient")),
        *((name, _P) for name in ("restitution_gradient", "friction_gradient", "gravity_gradient")),
        ("held_gradient", _P),
    )


@dataclass(frozen=True)
class Interval:
    """Substeps of one frame."""

    dt: float
    """[s]."""
    count: int
    seconds: float
    """The whole frame [s]."""


@dataclass(frozen=True)
class Graphs:
    """What is joined to what."""

    layout: Layout
    pieces: Pieces
    incidence: Incidence | None

    def fill(self, frame: Frame, alive: list[object]) -> None:
        """Write it into a frame; `alive` keeps what the pointers lead to."""
        layout, pieces, incidence = self.layout, self.pieces, self.incidence
        frame.pieces, frame.piece_start = len(pieces.origin), pieces.start.data_ptr()
        frame.reach, frame.origin = pieces.reach.data_ptr(), pieces.origin.data_ptr()
        frame.slices, frame.controllers = layout.slices, layout.controllers
        for kind, slots in (("spring", layout.springs), ("controller", layout.held)):
            setattr(frame, f"{kind}_start", slots.start.data_ptr())
            setattr(frame, f"{kind}_offset", slots.offset.data_ptr())
            setattr(frame, f"{kind}_rows", slots.rows)
        if incidence is not None:
            groups = (_L * len(incidence.laws))(*(law.rows for law in incidence.laws))
            corners = (_P * len(incidence.laws))(*(law.offset.data_ptr() for law in incidence.laws))
            alive += [groups, corners]
            frame.groups, frame.corners = ctypes.addressof(groups), ctypes.addressof(corners)
            frame.corner_row = incidence.corner_row.data_ptr()
            frame.incidence_start = incidence.points.start.data_ptr()
            frame.incidence_offset = incidence.points.offset.data_ptr()


@dataclass
class Buffers:
    """Contiguous tensors whose first dimension is the batch, of one element where all share it."""

    single: dict[str, Tensor] = field(default_factory=dict)
    """By the field of `Frame`; what is not there is null."""
    lists: dict[str, Sequence[Tensor | None]] = field(default_factory=dict)
    """The same for fields that hold one pointer each per constant or variable."""


def call(
    library: ctypes.CDLL,
    direction: str,
    graph: Graphs,
    interval: Interval,
    buffers: Buffers,
    whole: Mapping[str, int],
    batch: int,
) -> None:
    """Run `forward` or `backward` of a kernel.

    Args:
        library: The kernel.
        direction: Which.
        graph: What is joined to what.
        interval: Length and number of substeps.
        buffers: What is read and written.
        whole: `first`, `steps`, `ring` and `keep`.
        batch: Elements.
    """
    threads = min(torch.get_num_threads(), batch if batch > 1 else len(graph.pieces.origin))
    frames = (Frame * batch)()
    alive: list[object] = []
    first = frames[0]
    graph.fill(first, alive)
    first.dt, first.count, first.interval = interval.dt, interval.count, interval.seconds
    for name, value in whole.items():
        setattr(first, name, value)
    for frame in frames[1:]:
        ctypes.pointer(frame)[0] = first
    for name, tensor in buffers.single.items():
        if name != "pulls":
            for frame, address in zip(frames, _addresses(tensor, batch), strict=True):
                setattr(frame, name, address)
    if "pulls" in buffers.single:
        parts = [_addresses(part, batch) for part in buffers.single["pulls"]]
        for frame, pair in zip(frames, zip(*parts, strict=True), strict=True):
            frame.pulls = (_P * 2)(*pair)
    for name, tensors in buffers.lists.items():
        columns = [_addresses(tensor, batch) for tensor in tensors]
        for index, frame in enumerate(frames):
            pointers = (_P * max(1, len(columns)))(*(column[index] for column in columns))
            alive.append(pointers)
            setattr(frame, name, ctypes.addressof(pointers))
    getattr(library, direction)(frames, ctypes.c_int(batch), ctypes.c_int(threads))


def state_rows(layout: Layout) -> int:
    """Rows of a state: points, then controllers."""
    return point_rows(layout) + layout.controllers


def point_rows(layout: Layout) -> int:
    """Rows of points, those that only fill the last slice up included."""
    return layout.slices * LANES


def _addresses(tensor: Tensor | None, batch: int) -> Sequence[int | None]:
    """Where each element of a batch begins; the same for all where they share it."""
    if tensor is None or not tensor.numel():
        return [None] * batch
    assert tensor.is_contiguous()
    begin, size = tensor.data_ptr(), len(tensor)
    if size == 1:
        return [begin] * batch
    assert size == batch
    step = tensor.stride(0) * tensor.element_size()
    return range(begin, begin + step * batch, step)
