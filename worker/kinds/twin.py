"""A clip → a twin."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final

from pydantic import BaseModel

from model.job_schema import TwinRequest
from worker.kinds.base import Input, Kind, Outcome, Run

BUNDLE: Final = "bundle.twin.zip"
SHOWN: Final = ("preview.mp4", "twin.json", "parts.json", "parameters.json")
"""Members of the bundle that are also published by themselves."""
FILES: Final = ("mask", "camera", "mesh", "depth", "controllers")
"""Options of `TwinOptions` that are files."""


class TwinKind(Kind):
    """`matphys twin` as a job."""

    name: ClassVar[str] = "twin"
    queue: ClassVar[str] = "twins"
    options: ClassVar[type[BaseModel]] = TwinRequest
    inputs: ClassVar[Mapping[str, Input]] = {
        "video": Input("video", required=True),
        "mask": Input("image", help="The object on the keyframe, white on black."),
        "camera": Input("camera", help="Intrinsics and pose, as JSON."),
        "mesh": Input("mesh", help="A mesh of the object: GLB, OBJ or PLY."),
        "depth": Input("depth", help="Depth of the keyframe in millimetres: 16-bit PNG or .npy."),
        "controllers": Input("controllers", help="How the hand moved, instead of what is seen: .npz."),
    }
    limit_s: ClassVar[float] = 1800.0

    def run(self, run: Run) -> Outcome:
        """Build the twin, and lay what a page shows beside it."""
        pipeline, summary, doubts = run.model("pipeline"), run.model("summary"), run.model("doubts")
        chosen: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in run.record.options.items()
            if value is not None
        }
        given = {name: run.inputs[name] for name in FILES if name in run.inputs}
        with doubts.collect_doubts() as said:
            result = pipeline.build_twin(
                run.inputs["video"], pipeline.TwinOptions(**chosen, **given), run.report
            )
            bundle = run.folder / BUNDLE
            result.bundle.save(bundle)
        for warning in dict.fromkeys([*result.bundle.manifest.warnings, *said]):
            run.log(f"warning: {warning}")
        described = run.folder / "summary.json"
        described.write_bytes(run.model("schema").write_json(summary.describe(result.bundle)))
        return Outcome((bundle, *_members(bundle, run.folder), described), result.bundle.manifest.metrics)


def _members(bundle: Path, folder: Path) -> list[Path]:
    with zipfile.ZipFile(bundle) as archive:
        return [Path(archive.extract(name, folder)) for name in SHOWN if name in archive.namelist()]
