"""A twin → how it moves beside the clip."""

from dataclasses import replace

from pydantic import JsonValue

from model.bundle import TwinBundle
from model.manifest import with_metrics
from model.pipeline.sight import Sight
from model.preview import preview
from model.rendering import Renderer
from model.stage_log import StageLog, Step


def replay(bundle: TwinBundle, sight: Sight, renderer: Renderer, log: StageLog) -> TwinBundle:
    """Roll the twin out under the recorded hand, look at it through the clip's camera, and measure."""
    trajectory = log.run(
        "simulation",
        Step("semi-implicit Euler", "1"),
        lambda: bundle.rollout(progress=log.within("simulation")),
    )
    shown = log.run(
        "preview",
        Step(renderer.name, "1"),
        lambda: preview(
            sight.frames,
            sight.masks,
            sight.calibration,
            bundle.gaussians,
            bundle.topology,
            trajectory,
            bundle.controls,
            renderer,
        ),
    )
    metrics: dict[str, JsonValue] = {
        "keyframe_iou": round(float(shown.overlap[0]), 4),
        "silhouette_iou": round(float(shown.overlap.mean()), 4),
        "silhouette_iou_per_frame": [round(float(value), 4) for value in shown.overlap],
        "points": len(bundle.topology.points),
        "springs": len(bundle.topology.springs),
        "gaussians": len(bundle.gaussians),
        "substeps": int(trajectory.metadata["substeps_per_frame"]),
    }
    manifest = with_metrics(bundle.manifest, metrics).model_copy(
        update={"stages": tuple(log.records), "warnings": tuple(log.warnings)}
    )
    return replace(bundle, manifest=manifest, preview=shown.video)
