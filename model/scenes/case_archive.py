"""A case as named arrays and one text, and back: what its file holds."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from model.errors import InputError
from model.observation import parse_observation
from model.scenes.case import Anchors, Case, Interaction, ObjectClass, Truth
from model.scenes.case_check import check_arrays, check_prior
from model.types import Array, Camera, Estimate, Gaussians, MaterialPrior, Observation, ShapeClass, Topology

SCHEMA = "matphys.case/1"
RECORDS: Mapping[str, type] = {
    "topology": Topology,
    "observation": Observation,
    "gaussians": Gaussians,
    "anchors": Anchors,
    "truth": Truth,
    "camera": Camera,
}
"""Records whose arrays are stored as `RECORD.FIELD`."""
INDICES = {"springs", "part", "binding_index", "controller_springs", "index"}
DOUBLES = {"times", "intrinsics", "world_from_camera", "modulus"}
KEPT = {"colors": np.uint8, "parts": np.int64, "material": np.int64}
"""Types of an observation's and a truth's fields; all others are int32 (indices), float64 or float32."""
Record = TypeVar("Record")


class Strict(BaseModel):
    """Nothing is added to it and nothing changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PriorText(Strict):
    """A material prior."""

    distribution: list[float] = Field(min_length=10, max_length=10)
    properties: dict[str, tuple[float, float, str]]
    """Mean, spread, unit."""
    shape_class: ShapeClass


class TruthText(Strict):
    """What of the truth is no array; units as in `Truth`."""

    dashpot_damping: float
    drag_rate: float
    friction: float
    restitution: float


class CaseText(Strict):
    """What `case.json` holds."""

    schema_: str = Field(alias="schema", pattern=f"^{SCHEMA}$")
    name: str = Field(pattern=r"^[^/\\\x00]+$")
    """Files are named by it."""
    object_name: str
    object_class: ObjectClass
    interaction: Interaction
    shape_class: ShapeClass
    split: int
    priors: list[PriorText]
    image: tuple[int, int] | None
    """Width and height of the camera's image [px]; None: no camera."""
    truth: TruthText | None


def case_text(case: Case) -> dict[str, Any]:
    """Everything of the case that is no array, as `CaseText` has it."""
    priors = [
        PriorText(
            distribution=prior.distribution.tolist(),
            properties={key: (one.mean, one.spread, one.unit) for key, one in prior.properties.items()},
            shape_class=prior.shape_class,
        )
        for prior in case.priors
    ]
    truth, camera = case.truth, case.camera
    text = CaseText(
        schema=SCHEMA,
        name=case.name,
        object_name=case.object_name,
        object_class=case.object_class,
        interaction=case.interaction,
        shape_class=case.shape_class,
        split=case.split,
        priors=priors,
        image=None if camera is None else (camera.width, camera.height),
        truth=None
        if truth is None
        else TruthText(**{name: float(getattr(truth, name)) for name in TruthText.model_fields}),
    )
    return text.model_dump(by_alias=True)


def case_arrays(case: Case) -> dict[str, Array]:
    """Every array of the case by its name in the file; gravity and ground are arrays as in an observation."""
    found: dict[str, Array] = {"rest": case.rest}
    if case.complete is not None:
        found["complete"] = case.complete
    for record in RECORDS:
        holder = getattr(case, record)
        for name in _fields(record) if holder is not None else ():
            value = getattr(holder, name)
            if value is not None:
                found[f"{record}.{name}"] = np.asarray(value)
    return found


def _fields(record: str) -> Iterable[str]:
    """Fields of a record that are arrays."""
    left = {"warnings", "width", "height", "dashpot_damping", "drag_rate", "friction", "restitution"}
    return [one.name for one in fields(RECORDS[record]) if one.name not in left]


def array_names() -> list[str]:
    """The names of all arrays that a case may have."""
    return ["rest", "complete", *(f"{record}.{name}" for record in RECORDS for name in _fields(record))]


def assemble(text: CaseText, arrays: Mapping[str, Array], where: str) -> Case:
    """The case that was taken apart.

    Args:
        text: As `case_text` gave it.
        arrays: As `case_arrays` gave them.
        where: What messages call the source.

    Raises:
        InputError: an array is missing, or the arrays do not fit each other.
    """
    check_arrays(arrays, len(text.priors), where)
    try:
        case = _joined(text, arrays, where)
    except KeyError as error:
        raise InputError(f"{where}: expected the array {error.args[0]}, found none") from None
    for prior in case.priors:
        check_prior(prior, where)
    return case


def _joined(text: CaseText, arrays: Mapping[str, Array], where: str) -> Case:
    priors = tuple(
        MaterialPrior(
            distribution=np.array(prior.distribution),
            properties={key: Estimate(*values) for key, values in prior.properties.items()},
            shape_class=prior.shape_class,
        )
        for prior in text.priors
    )
    prefix = "observation."
    seen = {key.removeprefix(prefix): array for key, array in arrays.items() if key.startswith(prefix)}
    camera = None
    if text.image is not None:
        camera = _record(Camera, "camera", arrays, width=text.image[0], height=text.image[1])
    return Case(
        name=text.name,
        object_name=text.object_name,
        object_class=text.object_class,
        interaction=text.interaction,
        shape_class=text.shape_class,
        topology=_record(Topology, "topology", arrays),
        priors=priors,
        observation=parse_observation(seen, where),
        rest=_typed("rest", arrays["rest"]),
        anchors=_record(Anchors, "anchors", arrays),
        split=text.split,
        camera=camera,
        gaussians=_record(Gaussians, "gaussians", arrays) if "gaussians.means" in arrays else None,
        complete=_typed("complete", arrays["complete"]) if "complete" in arrays else None,
        truth=None if text.truth is None else _record(Truth, "truth", arrays, **text.truth.model_dump()),
    )


def _record(kind: type[Record], record: str, arrays: Mapping[str, Array], **scalars: float | int) -> Record:
    optional = {"harmonics"}
    found = {
        name: _typed(name, arrays[f"{record}.{name}"])
        for name in _fields(record)
        if name not in optional or f"{record}.{name}" in arrays
    }
    return kind(**found, **scalars)


def _typed(name: str, array: Array) -> Array:
    """A copy that can be written to, in the type of that field (Gaussians' colours are numbers 0..1)."""
    if name in INDICES:
        return np.array(array, np.int32)
    if name in DOUBLES:
        return np.array(array, np.float64)
    return np.array(array, KEPT["material"] if name == "material" else np.float32)
