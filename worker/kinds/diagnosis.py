"""What really moved → what its twin lacks."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Final

from pydantic import BaseModel, JsonValue

from model.errors import InputError
from model.job_schema import DiagnosisRequest
from worker.kinds.base import Input, Kind, Outcome, Run
from worker.kinds.twin import BUNDLE

DIAGNOSED: Final = "diagnosed.twin.zip"
"""The twin with what was found; absent where the verdict names no effect."""
OBSERVED: Final = "observation.npz"
"""What was seen in a video."""
WATCHING: Final = 0.3
"""Share of a job that looks at its video first."""


class DiagnosisKind(Kind):
    """`matphys diagnose` as a job; its parent is the twin."""

    name: ClassVar[str] = "diagnosis"
    queue: ClassVar[str] = "twins"
    options: ClassVar[type[BaseModel]] = DiagnosisRequest
    inputs: ClassVar[Mapping[str, Input]] = {
        "observation": Input(
            "observation",
            required=True,
            instead="video",
            help="What really moved, as matphys observe writes it; or send the clip instead.",
        ),
        "video": Input("video", help="The clip that the twin was made from, instead of an observation."),
        "transfer": Input(
            "observation",
            help="An observation of another motion, if there is one: does what is found hold there?",
        ),
        "mask": Input(
            "image", beside="video", help="If colour misleads: the object on the keyframe, white on black."
        ),
    }
    about: ClassVar[Mapping[str, str]] = {"segmentation": "video", "tracking": "video"}
    limit_s: ClassVar[float] = 1800.0

    def run(self, run: Run) -> Outcome:
        """Diagnose, and lay the report, its figures and the twin with what was found beside each other."""
        if run.parent is None:
            raise InputError("the twin is gone: make it again")
        twin = run.fetch(run.parent, BUNDLE)
        pipeline, doubts = run.model("pipeline"), run.model("doubts")
        made: list[Path] = []
        with doubts.collect_doubts() as said:
            seen, begun = run.inputs.get("observation"), 0.0
            if seen is None:
                seen, begun = self._observe(run, twin), WATCHING
                made.append(seen)
            result = pipeline.diagnose(
                seen,
                twin,
                run.inputs.get("transfer"),
                lambda stage, share: run.report(stage, begun + (1.0 - begun) * share),
            )
            made += result.write_report(run.folder)
            bundle = result.twin()
            if bundle is not None:
                bundle.save(run.folder / DIAGNOSED)
                made.append(run.folder / DIAGNOSED)
        for warning in dict.fromkeys([*result.report.warnings, *said]):
            run.log(f"warning: {warning}")
        return Outcome(tuple(made), _metrics(result.report.model_dump(mode="json")))

    def _observe(self, run: Run, twin: Path) -> Path:
        """What moved in a video, as the twin of that video sees it."""
        chosen = DiagnosisRequest.model_validate(run.record.options)
        observation = run.model("pipeline").observe(
            run.inputs["video"],
            twin,
            chosen.segmentation,
            chosen.tracking,
            run.inputs.get("mask"),
            lambda stage, share: run.report(stage, WATCHING * share),
        )
        path = run.folder / OBSERVED
        run.model("observation").write_observation(path, observation)
        return path


def _metrics(report: Mapping[str, Mapping[str, JsonValue]]) -> dict[str, JsonValue]:
    """The verdict and its figures, for lists of jobs."""
    verdict, gap = report["verdict"], report["gap"]
    figures = ("baseline", "refit", "with_effect", "noise_floor", "closed_fraction")
    return {"effect": verdict["effect"], "probability": verdict["probability"]} | {
        f"{name}_m" if name != "closed_fraction" else name: gap[name] for name in figures
    }
