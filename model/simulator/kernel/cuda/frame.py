"""What a launch of the CUDA kernel is told, as the struct `Frame` of engine.cu."""

import ctypes
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TypeAlias

from torch import Tensor

_P, _L, _D = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double

Values: TypeAlias = Mapping[str, Tensor | Sequence[Tensor | None] | None]
"""By field of `Frame`: contiguous tensors whose first dimension is the batch, of one element where all share
it; for fields that hold one per constant or variable, as many. None: null."""


class Field(ctypes.Structure):
    """Mirrors `Field` in engine.cu."""

    _fields_ = (("data", _P), ("stride", _L))


class SlotsStruct(ctypes.Structure):
    """Mirrors `Slots` in engine.cu."""

    _fields_ = (("start", _P), ("degree", _P), ("other", _P), ("count", _L))


@lru_cache(maxsize=64)
def frame_type(edges: int, scenes: int, memories: int, stencils: int) -> type[ctypes.Structure]:
    """`Frame` of engine.cu for that many constants, variables of memory and laws of stencils."""
    per_edge, per_scene = Field * max(1, edges), Field * max(1, scenes)
    per_memory, laws = Field * max(1, memories), max(1, stencils)
    fields = [
        *((name, _L) for name in ("points", "count", "first", "ring", "keep")),
        *((name, _D) for name in ("dt", "interval")),
        *((name, SlotsStruct) for name in ("springs", "held", "incidence")),
        *((name, _L * laws) for name in ("stencils", "corner_row")),
        ("corners", _P * laws),
        *((name, Field) for name in ("corner_forces", "corner_adjoints", "rows", "before", "after")),
        *((name, Field) for name in ("inverse_mass", "factor", "restitution", "friction", "height")),
        ("gravity", Field),
        ("edge", per_edge),
        ("scene", per_scene),
        ("memory", per_memory),
        ("adjoint", Field),
        ("pulls", Field * 2),
        ("memory_adjoint", per_memory),
        ("edge_gradient", per_edge),
        ("scene_gradient", per_scene),
        *((name, Field) for name in ("inverse_mass_gradient", "factor_gradient")),
        *((name, Field) for name in ("restitution_gradient", "friction_gradient", "gravity_gradient")),
        ("held_gradient", Field),
    ]
    return type("Frame", (ctypes.Structure,), {"_fields_": tuple(fields)})


def fill(frame: ctypes.Structure, values: Values, batch: int) -> None:
    """Write where values are into a frame."""
    for name, value in values.items():
        target = getattr(frame, name)
        if isinstance(value, Tensor) or value is None:
            _point(target, value, batch)
        else:
            for index, each in enumerate(value):
                _point(target[index], each, batch)


def _point(target: Field, tensor: Tensor | None, batch: int) -> None:
    if tensor is None or not tensor.numel():
        target.data, target.stride = None, 0
        return
    assert tensor.is_contiguous()
    assert len(tensor) in (1, batch)
    target.data = tensor.data_ptr()
    target.stride = 0 if len(tensor) == 1 else tensor.stride(0)
