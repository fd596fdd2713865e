"""`parameters.json`: the global mechanics of a twin, each with its unit and where it comes from."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float32

from model.errors import InputError
from model.schema import ParameterRecord, ParameterRecords, read_json, write_json
from model.types import STANDARD_GRAVITY, Array, Parameter, Parameters
from model.units import check_unit

BOUNDS: Mapping[str, tuple[float, float]] = {
    "dashpot_damping": (0, np.inf),
    "drag_rate": (0, np.inf),
    "friction": (0, np.inf),
    "restitution": (0, 1),
    "collision_distance": (0, np.inf),
    "bending_decay": (0, np.inf),
    "ground_height": (-np.inf, np.inf),
}
"""The scalars a simulator takes, and the smallest and largest that each may be."""
UNITS: Mapping[str, str] = {
    "dashpot_damping": "N*s/m",
    "drag_rate": "1/s",
    "friction": "1",
    "restitution": "1",
    "collision_distance": "m",
    "bending_decay": "1/s",
    "ground_height": "m",
    "gravity": "m/s^2",
}
"""Of each that a simulator takes."""
REQUIRED = ("dashpot_damping", "drag_rate", "friction", "restitution")


def encode_parameters(parameters: Parameters) -> bytes:
    """Write the global parameters."""
    records = {}
    for name, entry in parameters.globals.items():
        value = entry.value if isinstance(entry.value, tuple) else float(entry.value)
        record = {"value": value, "unit": entry.unit, "source": entry.source, "std": entry.std}
        records[name] = ParameterRecord.model_validate(record)
    return write_json(records)


def decode_parameters(
    data: bytes, stiffness: Float32[Array, " E"], controller_stiffness: Float32[Array, " S"], where: str
) -> Parameters:
    """Read and check the global parameters; parameters of other names are kept.

    Args:
        data: The file.
        stiffness: Of the springs [N/m], from `system.safetensors`.
        controller_stiffness: Of the controller springs [N/m].
        where: The file's name, for the message.

    Raises:
        InputError: a parameter is missing, malformed, out of bounds or in another unit.
    """
    records = read_json(data, ParameterRecords, where).root
    for name in REQUIRED:
        if name not in records:
            raise InputError(f"{where}: {name} is missing")
    for name, (low, high) in BOUNDS.items():
        value = records[name].value if name in records else low
        if isinstance(value, tuple) or not low <= value <= high:
            expected = "one number" if low == -np.inf else f"one number of {low:g} to {high:g}"
            raise InputError(f"{where}: {name}: expected {expected}, found {_say(value)}")
    gravity = records["gravity"].value if "gravity" in records else STANDARD_GRAVITY
    if isinstance(gravity, tuple) and len(gravity) != 3:
        raise InputError(f"{where}: gravity: expected one number or three, found {len(gravity)}")
    for name, unit in UNITS.items():
        if name in records:
            check_unit(records[name].unit, unit, f"{where}: {name}.unit")
    entries = {
        name: Parameter(record.value, record.unit, record.source, record.std)
        for name, record in records.items()
    }
    return Parameters(stiffness, controller_stiffness, entries)


def scalar(parameters: Parameters, name: str, default: float) -> float:
    """The value of a scalar parameter, or `default` where there is none."""
    entry = parameters.globals.get(name)
    value = default if entry is None else entry.value
    if isinstance(value, tuple):
        raise InputError(f"{name}: expected one number, found {_say(value)}")
    return float(value)


def gravity(parameters: Parameters) -> tuple[float, float, float]:
    """The vector of gravity [m/s²]: as given, or downwards by the one number given, or by 9.81."""
    entry = parameters.globals.get("gravity")
    if entry is None:
        return STANDARD_GRAVITY
    if isinstance(entry.value, tuple):
        x, y, z = entry.value
        return x, y, z
    return 0.0, 0.0, -abs(entry.value)


def ground_height(parameters: Parameters) -> float | None:
    """Height z of the ground plane [m]; None: no ground."""
    return scalar(parameters, "ground_height", 0.0) if "ground_height" in parameters.globals else None


def _say(value: float | tuple[float, ...]) -> str:
    return f"{value:g}" if isinstance(value, float) else str(list(value))
