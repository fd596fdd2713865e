"""A twin → the files of another program."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Final

from pydantic import BaseModel, ConfigDict, field_validator

from model.errors import InputError
from worker.kinds.base import Kind, Outcome, Run
from worker.kinds.twin import BUNDLE

FORMATS: Final[Mapping[str, str]] = {
    "ply": "twin.ply",
    "glb": "twin.glb",
    "usd": "twin.usdc",
    "mujoco": "mujoco",
    "newton": "newton",
    "phystwin": "phystwin",
}
"""Name of the format → the file or the folder that its exporter writes. A folder is published as a zip."""


class ExportOptions(BaseModel):
    """What a request for an export chooses."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: str

    @field_validator("format")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in FORMATS:
            raise ValueError(f"unknown format: choose one of {', '.join(FORMATS)}")
        return name


class ExportKind(Kind):
    """`matphys export` as a job; its parent is the twin."""

    name: ClassVar[str] = "export"
    queue: ClassVar[str] = "exports"
    options: ClassVar[type[BaseModel]] = ExportOptions
    limit_s: ClassVar[float] = 600.0

    def run(self, run: Run) -> Outcome:
        """Write the twin in the format asked for."""
        if run.parent is None:
            raise InputError("the twin is gone: make it again")
        format_ = ExportOptions.model_validate(run.record.options).format
        run.report("reading", 0.0)
        twin = run.model("bundle").TwinBundle.load(run.fetch(run.parent, BUNDLE))
        run.report("writing", 0.5)
        exporter = run.model("registry").by_name(run.model("exports").ALL_EXPORTERS, format_, "export")()
        out = run.folder / FORMATS[format_]
        exporter(twin, out)
        for loss in exporter.losses(twin):
            run.log(f"warning: {loss}")
        return Outcome((_one_file(out),))


def _one_file(out: Path) -> Path:
    """What was written as one file."""
    return Path(shutil.make_archive(str(out), "zip", out)) if out.is_dir() else out
