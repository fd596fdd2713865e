"""The JSON of jobs over HTTP (contract 6) as pydantic records; imports no torch and nothing that does."""

import re
from datetime import datetime
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, JsonValue

JobStatus: TypeAlias = Literal["queued", "running", "succeeded", "failed", "canceled"]
FINAL_STATUSES: tuple[JobStatus, ...] = ("succeeded", "failed", "canceled")
BOX_PATTERN = r"^[0-9]{1,5},[0-9]{1,5},[1-9][0-9]{0,4},[1-9][0-9]{0,4}$"
_LABEL = "[A-Za-z0-9_-]{1,63}"
_PORT = "(6553[0-5]|655[0-2][0-9]|65[0-4][0-9]{2}|6[0-4][0-9]{3}|[1-5][0-9]{4}|[1-9][0-9]{0,3})"
WEBHOOK_PATTERN = (
    rf"^https?://({_LABEL}(\.{_LABEL}){{0,9}}|\[[0-9A-Fa-f:.]{{2,45}}\])(:{_PORT})?([/?][!-~]*)?$"
)
"""An address that can be posted to, without a user and a password."""
EXAMPLE_ID = "0660cb83a5e29d2dd5916253e89dc2c4"


def _four_numbers(value: object) -> object:
    """Split `x,y,w,h`; what is something else is left to the validation that follows."""
    return value.split(",") if isinstance(value, str) and re.fullmatch(BOX_PATTERN, value) else value


def _box_schema(schema: dict[str, Any]) -> None:
    """Over HTTP a box is one text."""
    description = schema.get("description")
    schema.clear()
    schema |= {
        "type": "string",
        "pattern": BOX_PATTERN,
        "description": description,
        "examples": ["120,80,200,150"],
    }


Pixel: TypeAlias = Annotated[int, Field(ge=0, le=99_999)]
Pixels: TypeAlias = Annotated[int, Field(ge=1, le=99_999)]


class JobRequest(BaseModel):
    """What every request for a job may carry beside its files."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    webhook: Annotated[
        str | None,
        Field(
            max_length=2000,
            pattern=WEBHOOK_PATTERN,
            description="Told by a signed POST (Standard Webhooks) when the job has ended.",
            examples=["https://example.org/hooks/matphys"],
        ),
    ] = None


class TwinRequest(JobRequest):
    """What a request for a twin may choose; each is an option of `matphys twin`."""

    box: Annotated[
        tuple[Pixel, Pixel, Pixels, Pixels] | None,
        BeforeValidator(_four_numbers),
        Field(
            description="A box around the object on the keyframe [px]: x,y,width,height.",
            json_schema_extra=_box_schema,
        ),
    ] = None
    keyframe: Annotated[
        int | None, Field(ge=0, le=100_000, description="The frame to reconstruct from.", examples=[0])
    ] = None
    size_m: Annotated[
        float | None,
        Field(ge=0.01, le=100, description="The longest side of the object [m].", examples=[0.3]),
    ] = None
    shape: Annotated[
        Literal["auto", "sheet", "rope", "solid"], Field(description="What fills the silhouette.")
    ] = "auto"
    prior: Annotated[Literal["stub", "openai"], Field(description="Who names the materials.")] = "stub"
    predictor: Annotated[
        Literal["matphys", "prior-mean"],
        Field(description="Who predicts the mechanics: a trained network, or the prior's means."),
    ] = "matphys"
    parts: Annotated[int, Field(ge=1, le=64, description="How many parts to look for.")] = 5
    points: Annotated[int, Field(ge=16, le=20_000, description="About how many mass points.")] = 1500
    segmentation: Annotated[Literal["classical", "sam2"], Field(description="Who finds the object.")] = (
        "classical"
    )
    tracking: Annotated[Literal["opencv", "cotracker"], Field(description="Who follows the object.")] = (
        "opencv"
    )
    reconstruction: Annotated[
        Literal["silhouette", "mesh", "depth"] | None,
        Field(
            description="How the shape is found. Left out: `mesh` with a mesh, `depth` with depth, "
            "else `silhouette`."
        ),
    ] = None
    encoder: Annotated[Literal["texture", "dinov2"], Field(description="What tells parts apart.")] = "texture"
    seed: Annotated[int, Field(ge=0, le=2**31 - 1, description="Of everything drawn by lot.")] = 0


class DiagnosisRequest(JobRequest):
    """What a request for a diagnosis may choose; how a video is looked at, where it brings one."""

    segmentation: Annotated[
        Literal["classical", "sam2"], Field(description="Who finds the object in a video.")
    ] = "classical"
    tracking: Annotated[
        Literal["opencv", "cotracker"], Field(description="Who follows it through a video.")
    ] = "opencv"


class Answer(BaseModel):
    """What every answer shares."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


PROBLEM = "urn:matphys:problem:"
"""How the type of every problem begins, in answers and in webhooks."""


class JobError(Answer):
    """Why a job failed."""

    type: Annotated[str, Field(examples=["urn:matphys:problem:bad-input"])]
    title: Annotated[str, Field(examples=["The input cannot be used"])]
    detail: Annotated[
        str | None, Field(examples=["clip.mp4: breaks off after frame 12 of 90; copy it again"])
    ] = None


class JobFile(Answer):
    """One file that a job made."""

    name: Annotated[str, Field(examples=["bundle.twin.zip"])]
    bytes: Annotated[int, Field(ge=0, examples=[1_482_113])]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$", examples=["9f86d081884c7d65" * 4])]
    url: Annotated[str, Field(examples=[f"/twins/{EXAMPLE_ID}/files/bundle.twin.zip"])]


class Job(Answer):
    """A job: what it is, how far it is, what it made. A final status never changes."""

    id: Annotated[str, Field(examples=[EXAMPLE_ID])]
    kind: Annotated[str, Field(examples=["twin"])]
    status: JobStatus
    stage: Annotated[str | None, Field(description="The stage under way.", examples=["tracking"])] = None
    progress: Annotated[float, Field(ge=0, le=100, description="Of the whole [%].", examples=[42.5])] = 0.0
    queue_position: Annotated[
        int | None, Field(ge=0, description="Jobs that go first; only while queued.", examples=[None])
    ] = None
    created_at: datetime
    started_at: datetime | None = None
    completed_at: datetime | None = None
    expires_at: Annotated[datetime | None, Field(description="When the job and its files are deleted.")] = (
        None
    )
    parent: Annotated[
        str | None, Field(description="The job this one works on, where it does.", examples=[None])
    ] = None
    options: Annotated[dict[str, JsonValue], Field(examples=[{"parts": 5, "size_m": 0.3}])] = {}
    error: JobError | None = None
    metrics: Annotated[dict[str, JsonValue], Field(examples=[{"silhouette_iou": 0.91}])] = {}
    files: tuple[JobFile, ...] = ()
    urls: Annotated[
        dict[str, str],
        Field(
            examples=[
                {
                    "self": f"/twins/{EXAMPLE_ID}",
                    "events": f"/twins/{EXAMPLE_ID}/events",
                    "logs": f"/twins/{EXAMPLE_ID}/logs",
                    "cancel": f"/twins/{EXAMPLE_ID}/cancel",
                }
            ]
        ),
    ] = {}
    webhook: str | None = None


class JobPage(Answer):
    """Some of the jobs, newest first."""

    items: tuple[Job, ...]
    next_cursor: Annotated[
        str | None, Field(description="Give it as `cursor` for those that follow; null: there are none.")
    ] = None


class WebhookSecret(Answer):
    """What webhooks are signed with (Standard Webhooks)."""

    secret: Annotated[str, Field(pattern="^whsec_", examples=["whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"])]


class Problem(Answer):
    """An error (RFC 9457)."""

    type: Annotated[str, Field(examples=["urn:matphys:problem:not-found"])]
    title: Annotated[str, Field(examples=["Not found"])]
    status: Annotated[int, Field(ge=400, le=599, examples=[404])]
    detail: Annotated[str | None, Field(examples=["there is no such twin"])] = None
    instance: Annotated[str | None, Field(description="The request, as our log names it.")] = None
    errors: Annotated[
        tuple[dict[str, str], ...] | None, Field(description="For 422: each field and what is wrong with it.")
    ] = None
