"""`system.safetensors`: mass points, springs, controllers and binding, checked before anyone uses them."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float32
from safetensors import SafetensorError, deserialize
from safetensors.numpy import save

from model.errors import InputError
from model.formats.shapes import Shape, check_shape
from model.types import Array, Topology

FLOATS: Mapping[str, str] = {"F32": "<f4", "F64": "<f8"}
INTEGERS: Mapping[str, str] = {"I32": "<i4", "I64": "<i8"}
HEADER_LIMIT = 1 << 16
BINDING_TOLERANCE = 1e-3

REQUIRED: Mapping[str, tuple[Mapping[str, str], Shape]] = {
    "points": (FLOATS, ("N", 3)),
    "mass": (FLOATS, ("N",)),
    "springs": (INTEGERS, ("E", 2)),
    "rest_length": (FLOATS, ("E",)),
    "stiffness": (FLOATS, ("E",)),
    "part": (INTEGERS, ("N",)),
    "binding_index": (INTEGERS, ("G", "k")),
    "binding_weight": (FLOATS, ("G", "k")),
}
OPTIONAL: Mapping[str, tuple[Mapping[str, str], Shape]] = {
    "controller_springs": (INTEGERS, ("S", 2)),
    "controller_rest_length": (FLOATS, ("S",)),
    "controller_stiffness": (FLOATS, ("S",)),
    "controls": (FLOATS, ("T", "C", 3)),
    "controller_points": (FLOATS, ("C", 3)),
}
POSITIVE = ("mass", "rest_length", "stiffness")
NOT_NEGATIVE = ("controller_rest_length", "controller_stiffness")

Tensors: TypeAlias = dict[str, Array]


@dataclass(frozen=True)
class System:
    """What `system.safetensors` holds."""

    topology: Topology
    stiffness: Float32[Array, " E"]
    """[N/m]."""
    controller_stiffness: Float32[Array, " S"]
    """[N/m]."""
    controls: Float32[Array, "T C 3"] | None
    """The recorded motion [m], if any."""


def encode_system(system: System) -> bytes:
    """Write the tensors of a twin; equal tensors give equal bytes."""
    topology = system.topology
    tensors = {name: getattr(topology, name) for name in (*REQUIRED, *OPTIONAL) if hasattr(topology, name)}
    tensors |= {"stiffness": system.stiffness, "controller_stiffness": system.controller_stiffness}
    if system.controls is not None:
        tensors["controls"] = system.controls
    kinds = {**REQUIRED, **OPTIONAL}
    # The file holds the raw buffer, so strides and byte order must be plain.
    return save(
        {
            name: np.ascontiguousarray(value, "<f4" if kinds[name][0] is FLOATS else "<i4")
            for name, value in tensors.items()
        }
    )


def decode_system(data: bytes, where: str) -> System:
    """Read and check the tensors of a twin.

    Tensors of other names are ignored. Double precision becomes single, 64-bit integers become 32-bit.
    Absent controllers become empty ones.

    Args:
        data: The file.
        where: Its name, for the message.

    Raises:
        InputError: a tensor is missing, of another kind or shape, not finite, or points outside of another.
    """
    tensors = _read(data, where)
    _check_shapes(tensors, where)
    _check_values(tensors, where)
    topology = Topology(
        points=tensors["points"],
        mass=tensors["mass"],
        springs=tensors["springs"],
        rest_length=tensors["rest_length"],
        part=tensors["part"],
        binding_index=tensors["binding_index"],
        binding_weight=tensors["binding_weight"],
        controller_points=tensors["controller_points"],
        controller_springs=tensors["controller_springs"],
        controller_rest_length=tensors["controller_rest_length"],
    )
    controls = tensors["controls"] if len(tensors["controls"]) else None
    return System(topology, tensors["stiffness"], tensors["controller_stiffness"], controls)


def _read(data: bytes, where: str) -> Tensors:
    """Parse the file into arrays of the right precision."""
    _check_header(data, where)
    parse: Callable[[bytes], list[tuple[str, dict[str, Any]]]] = deserialize
    try:
        found = dict(parse(data))
    except SafetensorError as error:
        raise InputError(f"{where}: expected a safetensors file, found a damaged one ({error})") from None
    kinds = {**REQUIRED, **OPTIONAL}
    tensors = {name: _convert(name, found[name], kinds[name][0], where) for name in kinds if name in found}
    for name in REQUIRED:
        if name not in tensors:
            raise InputError(f"{where}: {name} is missing")
    return tensors


def _check_header(data: bytes, where: str) -> None:
    """Refuse, with a clear line, what is plainly no safetensors file or has an absurd header."""
    length = int.from_bytes(data[:8], "little")
    if len(data) < 10 or length > len(data) - 8:
        raise InputError(f"{where}: expected a safetensors file, found {len(data)} other bytes")
    if length > HEADER_LIMIT:
        raise InputError(f"{where}: expected a header of at most {HEADER_LIMIT} bytes, found {length}")
    try:
        json.loads(data[8 : 8 + length])
    except (ValueError, RecursionError):
        raise InputError(f"{where}: expected a safetensors file, found a header that is not JSON") from None


def _convert(name: str, tensor: dict[str, Any], kinds: Mapping[str, str], where: str) -> Array:
    kind, shape = str(tensor["dtype"]), tuple(tensor["shape"])
    if kind not in kinds:
        expected = " or ".join(np.dtype(code).name for code in kinds.values())
        raise InputError(f"{where}: {name}: expected {expected}, found {kind}")
    values = np.frombuffer(bytes(tensor["data"]), kinds[kind]).reshape(shape)
    if kinds is INTEGERS:
        bad = (values < 0) | (values > np.iinfo(np.int32).max)
        if bad.any():
            raise InputError(f"{where}: {name}: expected indices from 0, found {values[bad][0]}")
        return values.astype(np.int32)
    with np.errstate(over="ignore"):
        single = values.astype(np.float32)
    if not np.isfinite(single).all():
        row = int(np.argwhere(~np.isfinite(single))[0][0])
        raise InputError(f"{where}: {name}[{row}]: expected finite numbers, found NaN or infinity")
    return single


def _check_shapes(tensors: Tensors, where: str) -> None:
    """Check the shapes against each other, and fill in what may be absent."""
    sizes: dict[str, int] = {}
    for name, (kind, shape) in {**REQUIRED, **OPTIONAL}.items():
        if name not in tensors:
            tensors[name] = _absent(name, kind, sizes, tensors)
        found = tensors[name].shape
        if name == "controls" and 0 in found[:1]:
            tensors[name] = np.zeros((0, 0, 3), np.float32)
            continue
        check_shape(name, found, shape, sizes, where)
    if sizes["N"] < 1 or sizes["k"] < 1:
        raise InputError(f"{where}: expected at least one point and one point per Gaussian, found none")


def _absent(name: str, kind: Mapping[str, str], sizes: Mapping[str, int], tensors: Tensors) -> Array:
    """What an optional tensor is when the file lacks it: empty, or the controllers' first place."""
    dtype = np.float32 if kind is FLOATS else np.int32
    if name == "controller_points" and "C" in sizes:
        first: Array = tensors["controls"][0]
        return first
    shape = tuple(0 if isinstance(size, str) else size for size in OPTIONAL[name][1])
    return np.zeros(shape, dtype)


def _check_values(tensors: Tensors, where: str) -> None:
    for name in (*POSITIVE, *NOT_NEGATIVE):
        values = tensors[name]
        bad = values <= 0 if name in POSITIVE else values < 0
        if bad.any():
            row, kind = int(np.argmax(bad)), "a positive number" if name in POSITIVE else "a number from 0"
            raise InputError(f"{where}: {name}[{row}]: expected {kind}, found {values[row]:g}")
    points, controllers = len(tensors["points"]), len(tensors["controller_points"])
    _check_range("springs", tensors["springs"], points, where)
    _check_range("binding_index", tensors["binding_index"], points, where)
    _check_range("controller_springs", tensors["controller_springs"][:, 0], controllers, where)
    _check_range("controller_springs", tensors["controller_springs"][:, 1], points, where)
    loops = tensors["springs"][:, 0] == tensors["springs"][:, 1]
    if loops.any():
        row = int(np.argmax(loops))
        raise InputError(f"{where}: springs[{row}]: expected two different points, found one twice")
    _check_duplicates("springs", np.sort(tensors["springs"], axis=1), where)
    _check_duplicates("controller_springs", tensors["controller_springs"], where)
    sums = tensors["binding_weight"].sum(axis=1, dtype=np.float64)
    bad = np.abs(sums - 1) > BINDING_TOLERANCE
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"{where}: binding_weight[{row}]: expected weights that sum to 1, found {sums[row]:g}"
        )


def _check_range(name: str, indices: Array, count: int, where: str) -> None:
    bad = (indices if indices.ndim > 1 else indices[:, None]).max(axis=1, initial=-1) >= count
    if bad.any():
        row = int(np.argmax(bad))
        expected = f"expected indices 0..{count - 1}" if count else "expected none (nothing to point at)"
        raise InputError(f"{where}: {name}[{row}]: {expected}, found {indices[row].max()}")


def _check_duplicates(name: str, pairs: Array, where: str) -> None:
    _, first, counts = np.unique(pairs, axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        row = int(first[counts > 1].min())
        raise InputError(f"{where}: {name}[{row}]: expected every pair once, found it {counts.max()} times")
