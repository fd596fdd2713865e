"""The JSON of a twin bundle (contract 4) as pydantic records; imports no torch and nothing that does.

Reading is strict about types and finite numbers and lenient about absence: a manifest written by another
program needs little more than its `schema`. Unknown keys are kept, so that loading and saving loses nothing.
"""

import base64
import binascii
import hashlib
import json
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NoReturn, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, JsonValue, RootModel, ValidationError, field_validator

from model.errors import InputError

SCHEMA: Literal["matphys.twin/1"] = "matphys.twin/1"
UNITS = "m kg s"
FRAME = "z-up"

ParameterSource: TypeAlias = Literal["predicted", "prior", "fitted", "user"]
EffectName: TypeAlias = Literal[
    "strain_stiffening",
    "viscoelasticity",
    "plasticity",
    "damage",
    "tension_only",
    "anisotropy",
    "bending_stiffness",
    "volume_preservation",
    "quadratic_air_drag",
    "wind",
    "gravity_tilt",
    "mass_heterogeneity",
    "grip_slip",
    "actuation_delay",
    "adhesion",
    "static_friction",
    "self_collision",
]
Row3: TypeAlias = tuple[float, float, float]
Row4: TypeAlias = tuple[float, float, float, float]
Positive: TypeAlias = Annotated[float, Field(gt=0)]
NonNegative: TypeAlias = Annotated[float, Field(ge=0)]
Size: TypeAlias = Annotated[int, Field(gt=0)]
Count: TypeAlias = Annotated[int, Field(ge=0)]
ROTATED = 1e-2
"""By how much rows of a rotation may differ from being of length 1 and at right angles."""
MOST_FRAMES = 100_000
"""Of a clip, an hour of it: what a twin says of its own is simulated where nobody gives other controls."""
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"


class Record(BaseModel):
    """What every record shares: frozen, finite, keeps the keys it does not know."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class CameraRecord(Record):
    """The pinhole camera the twin was reconstructed with (OpenCV axes)."""

    intrinsics: tuple[Row3, Row3, Row3] | None = None
    """K [px]."""
    world_from_camera: tuple[Row4, Row4, Row4, Row4] | None = None
    """Pose: camera → world [m]."""
    width: Size | None = None
    height: Size | None = None
    source: str | None = None
    """How intrinsics and pose were fixed."""

    @field_validator("intrinsics")
    @classmethod
    def _is_pinhole(cls, rows: tuple[Row3, Row3, Row3] | None) -> tuple[Row3, Row3, Row3] | None:
        if rows is None:
            return None
        (fx, _, _), (zero, fy, _), last = rows
        if not (fx > 0.0 and fy > 0.0 and zero == 0.0 and last == (0.0, 0.0, 1.0)):
            raise ValueError("expected ((fx, s, cx), (0, fy, cy), (0, 0, 1)) with fx and fy above 0")
        return rows

    @field_validator("world_from_camera")
    @classmethod
    def _is_pose(cls, rows: tuple[Row4, Row4, Row4, Row4] | None) -> tuple[Row4, Row4, Row4, Row4] | None:
        if rows is not None:
            turn = [row[:3] for row in rows[:3]]
            products = [
                sum(a * b for a, b in zip(one, other, strict=True)) - (one is other)
                for one in turn
                for other in turn
            ]
            if rows[3] != (0.0, 0.0, 0.0, 1.0) or max(map(abs, products)) > ROTATED:
                raise ValueError("expected a rotation and a place [m] above a last row of 0, 0, 0, 1")
        return rows


class SourceRecord(Record):
    """The clip, and how the image was turned into metres and an upright world."""

    sha256: str | None = None
    name: str | None = None
    fps: Positive | None = None
    """[1/s]; also the time step of the recorded controls."""
    frames: Annotated[int, Field(gt=0, le=MOST_FRAMES)] | None = None
    width: Size | None = None
    height: Size | None = None
    keyframe: Count | None = None
    camera: CameraRecord | None = None
    scale: JsonValue = None
    """How metres were fixed: one sentence."""
    gravity: JsonValue = None
    """How the direction of gravity was fixed: one sentence."""
    ground: JsonValue = None
    """How the ground was fixed: one sentence."""


class StageRecord(Record):
    """One stage of the pipeline and the method that served it."""

    name: str
    method: str | None = None
    version: str | None = None
    weights: str | None = None
    """sha256 of the weights file; None: no weights."""
    seconds: NonNegative | None = None
    """None in the bundles written here: a measured time would break `same input, same bytes`."""
    warnings: tuple[str, ...] = ()


class BundleManifest(Record):
    """`twin.json`."""

    # The key is `schema`, which is also the name of a method of BaseModel.
    schema_: Literal["matphys.twin/1"] = Field(alias="schema")
    id: str = ""
    created: str | None = None
    """When, ISO 8601, UTC."""
    version: str | None = None
    """Of the software that wrote the bundle."""
    units: JsonValue = UNITS
    frame: JsonValue = FRAME
    source: SourceRecord = SourceRecord()
    stages: tuple[StageRecord, ...] = ()
    metrics: dict[str, JsonValue] = {}
    warnings: tuple[str, ...] = ()

    @field_validator("units")
    @classmethod
    def _metric(cls, units: JsonValue) -> JsonValue:
        if isinstance(units, str) and {"mm", "cm", "inch", "in", "ft", "g", "ms"} & set(
            units.lower().split()
        ):
            raise ValueError(f"expected metres, kilograms and seconds ({UNITS!r})")
        return units

    @field_validator("frame")
    @classmethod
    def _upright(cls, frame: JsonValue) -> JsonValue:
        words = frame.lower().replace("_", "-").replace(" ", "-") if isinstance(frame, str) else ""
        if any(other in words for other in ("x-up", "y-up", "z-down", "x-down", "y-down")):
            raise ValueError(f"expected the world frame {FRAME!r}")
        return frame


class ParameterRecord(Record):
    """One global physical parameter in `parameters.json`."""

    value: float | tuple[float, ...]
    unit: str
    source: ParameterSource
    std: NonNegative | None = None


class PropertyRecord(Record):
    """A log-normal belief about one material property."""

    mean: Positive
    """The median, in `unit`."""
    spread: NonNegative
    """Standard deviation of the natural logarithm."""
    unit: str


class StiffnessRecord(Record):
    """Statistics of the springs that have both ends in a part [N/m]."""

    springs: Count
    mean: float | None = None
    std: float | None = None
    minimum: float | None = None
    median: float | None = None
    maximum: float | None = None


class SizeRecord(Record):
    """How large a part is."""

    points: Count
    gaussians: Count | None = None
    mass: NonNegative | None = None
    """[kg]."""
    extent: Row3 | None = None
    """Along x, y, z [m]."""


class PartRecord(Record):
    """One part in `parts.json`."""

    label: str | int
    materials: dict[str, Annotated[float, Field(ge=0, le=1)]] = {}
    """Probability of each of the ten classes; sums to 1."""
    prior: dict[str, PropertyRecord] = {}
    stiffness: StiffnessRecord | None = None
    size: SizeRecord | None = None
    overlay: str | None = None
    """The part highlighted on the keyframe: a PNG in base64."""

    @field_validator("materials")
    @classmethod
    def _distribution(cls, materials: dict[str, float]) -> dict[str, float]:
        if materials and abs(math.fsum(materials.values()) - 1) > 1e-3:
            raise ValueError("expected probabilities that sum to 1")
        return materials

    @field_validator("overlay")
    @classmethod
    def _png(cls, overlay: str | None) -> str | None:
        try:
            if overlay is not None and not base64.b64decode(overlay, validate=True).startswith(PNG_MAGIC):
                raise ValueError("expected a PNG in base64")
        except binascii.Error:
            raise ValueError("expected a PNG in base64") from None
        return overlay


class EffectRecord(Record):
    """One effect that a diagnosis added, in `effects.json`."""

    name: EffectName
    parameters: dict[str, JsonValue] = {}
    acts_on: tuple[Annotated[float, Field(ge=0, le=1)], ...] | None = None
    """How strongly it acts on each point, length N; None: on all alike."""


class ParameterRecords(RootModel[dict[str, ParameterRecord]]):
    """`parameters.json`."""


class PartRecords(RootModel[tuple[PartRecord, ...]]):
    """`parts.json`."""


class EffectRecords(RootModel[tuple[EffectRecord, ...]]):
    """`effects.json`."""


Payload = TypeVar("Payload", bound=BaseModel)


def read_json(data: bytes, kind: type[Payload], where: str) -> Payload:
    """Parse and validate one JSON member.

    Args:
        data: UTF-8 JSON.
        kind: What it has to be.
        where: File and member, for the message.

    Raises:
        InputError: not JSON, a number that is not finite, or not what `kind` asks for.
    """
    try:
        json.loads(data, parse_constant=_refuse_constant, parse_float=_finite)
        return kind.model_validate_json(data, strict=True)
    except ValidationError as error:
        raise InputError(f"{where}: {_first_problem(error)}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: expected JSON, found something else ({error})") from None


def write_json(content: Any) -> bytes:  # noqa: ANN401 - whatever JSON can express
    """Encode records, deterministically and readable."""

    def plain(value: Any) -> Any:  # noqa: ANN401
        return value.model_dump(mode="json", by_alias=True)

    return (json.dumps(content, default=plain, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def content_id(source_sha256: str, options: Mapping[str, JsonValue], version: str) -> str:
    """The id of a twin: the same clip, options and software give the same id."""
    text = json.dumps([source_sha256, dict(options), version], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a finite number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not a finite number")
    return value


def _first_problem(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    key = ".".join(str(step) for step in first["loc"]) or "the whole"
    if first["type"] == "missing":
        return f"{key} is missing"
    found = repr(first["input"])
    found = found if len(found) <= 60 else found[:57] + "..."
    message = first["msg"].removeprefix("Value error, ")
    message = message if len(message) <= 160 else message[:157] + "..."
    return f"{key}: {message[0].lower()}{message[1:]}, found {found}"
