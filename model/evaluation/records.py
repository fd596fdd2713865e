"""What was measured of one method on one case, as a line of JSON."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

from pydantic import BaseModel, ConfigDict, ValidationError

from model.errors import InputError
from model.formats.files import replacing
from model.scenes.object_group import object_group

Scores: TypeAlias = dict[str, float]
"""By metric: `chamfer`, `track`, `matched` [m]; `iou`, `psnr` and `psnr_object` [dB], `ssim`, `lpips`."""


class Strict(BaseModel):
    """No unknown names."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PartRecord(Strict):
    """One part: what it is, what it was taken for."""

    part: int
    material: str
    """The true one; the one that the prior thinks likeliest where the truth is not known."""
    log_truth: float | None
    """ln of the true modulus [Pa]."""
    log_estimate: float
    """ln of the estimate [Pa]."""
    log_spread: float | None
    """Standard deviation that the method states."""


class GlobalRecord(Strict):
    """One parameter of the whole object."""

    truth: float
    estimate: float
    std: float | None


class Transfer(Strict):
    """Another interaction of the same object, predicted by what was learned from the first."""

    case: str
    interaction: str
    scores: Scores
    failed: str | None = None


class Record(Strict):
    """One method on one case."""

    key: str
    """Of everything that the result depends on: equal keys need no second run."""
    method: str
    """Its name in tables."""
    identity: str
    """Which version of it, with which weights."""
    case: str
    object_name: str
    object_class: str
    interaction: str
    priors: str
    """Whose opinion the priors are: `given`, `right`, `uniform`, `wrong`."""
    known_object: bool
    """Whether the method was trained on the folder of cases that this object is of."""
    fit_seconds: float
    predict_seconds: float
    failed: str | None
    """Why there is no prediction of the case's own motion; it is then scored as if nothing moved any more."""
    reconstruction: Scores
    """Frames 1 … split - 1 of the case itself."""
    future: Scores
    """Frames split … T - 1."""
    unseen: list[Transfer]
    curve: list[float]
    """Track error of every frame of the case itself [m]; frames of which nothing is known have what lies
    between those beside them."""
    parts: list[PartRecord]
    globals: dict[str, GlobalRecord]

    @property
    def thing(self) -> str:
        """What was recorded: clips of one thing are not independent, whatever their objects are called."""
        return object_group(self.object_name)


def read_records(path: Path) -> list[Record]:
    """Records of a file; a last line that was cut off by an interruption is left out.

    Raises:
        InputError: a line is no record.
    """
    if not path.is_file():
        return []
    lines = path.read_bytes().split(b"\n")
    whole, cut = lines[:-1], lines[-1]
    try:
        return [Record.model_validate_json(line) for line in whole if line.strip()]
    except ValidationError as error:
        first = error.errors()[0]["msg"]
        hint = "give another --out, or delete the file" if not cut else "delete the file"
        raise InputError(f"{path}: a line is no record of this version ({first}): {hint}") from None


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Replace the file by these records."""
    with replacing(path) as temporary:
        temporary.write_text("".join(line(record) for record in records))


def line(record: Record) -> str:
    """A record as one line."""
    return json.dumps(record.model_dump(), ensure_ascii=False, allow_nan=False) + "\n"
