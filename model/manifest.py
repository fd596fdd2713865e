"""What the pipeline knows → the JSON records of the bundle."""

import base64
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np
from jaxtyping import Bool, Float32
from pydantic import JsonValue

from model.priors.materials import MATERIALS
from model.priors.overlay import overlay_png
from model.schema import (
    SCHEMA,
    BundleManifest,
    CameraRecord,
    PartRecord,
    PropertyRecord,
    SizeRecord,
    SourceRecord,
    StiffnessRecord,
    content_id,
)
from model.types import Array, Calibration, Frames, MaterialPrior, Parameters, Parts, PartView, Topology
from model.version import __version__


def write_manifest(
    frames: Frames, keyframe: int, calibration: Calibration, options: Mapping[str, JsonValue]
) -> BundleManifest:
    """The manifest of a twin that has not been replayed: no stages, no metrics yet.

    Args:
        frames: The clip.
        keyframe: Where the twin starts.
        calibration: How the world was fixed.
        options: What the user chose, files by their content; with the clip it gives the id.
    """
    camera = calibration.camera
    count, height, width = frames.images.shape[:3]
    source = SourceRecord(
        sha256=frames.sha256,
        name=frames.name,
        fps=frames.fps,
        frames=count,
        width=width,
        height=height,
        keyframe=keyframe,
        camera=CameraRecord.model_validate(
            {
                "intrinsics": camera.intrinsics.tolist(),
                "world_from_camera": camera.world_from_camera.tolist(),
                "width": camera.width,
                "height": camera.height,
                "source": calibration.camera_source,
            }
        ),
        scale=calibration.scale_source,
        gravity=calibration.camera_source,
        ground=calibration.ground_source,
    )
    return BundleManifest.model_validate(
        {
            "schema": SCHEMA,
            "id": content_id(frames.sha256, options, __version__),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "version": __version__,
            "source": source,
        }
    )


def with_metrics(manifest: BundleManifest, metrics: Mapping[str, JsonValue]) -> BundleManifest:
    """The manifest with further metrics, in the place of those of the same name."""
    return manifest.model_copy(update={"metrics": {**manifest.metrics, **metrics}})


def describe_parts(
    views: Sequence[PartView],
    priors: Sequence[MaterialPrior],
    parts: Parts,
    topology: Topology,
    parameters: Parameters,
) -> tuple[PartRecord, ...]:
    """One record a part: what it is believed to be made of, its springs, its size, its overlay."""
    ends = topology.part[topology.springs]
    records = []
    for part, (view, prior) in enumerate(zip(views, priors, strict=True)):
        inside = (ends == part).all(axis=1)
        members = topology.part == part
        records.append(
            PartRecord(
                label=view.label,
                materials={
                    name: float(share) for name, share in zip(MATERIALS, prior.distribution, strict=True)
                },
                prior={
                    name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
                    for name, belief in prior.properties.items()
                },
                stiffness=stiffness_record(parameters.stiffness[inside]),
                size=_size(topology, members, int((parts.labels == part).sum())),
                overlay=base64.b64encode(overlay_png(view)).decode(),
            )
        )
    return tuple(records)


def stiffness_record(stiffness: Float32[Array, " E"]) -> StiffnessRecord:
    """Statistics of the springs of a part [N/m]."""
    values = stiffness.astype(np.float64)
    if not len(values):
        return StiffnessRecord(springs=0)
    return StiffnessRecord(
        springs=len(values),
        mean=float(values.mean()),
        std=float(values.std()),
        minimum=float(values.min()),
        median=float(np.median(values)),
        maximum=float(values.max()),
    )


def _size(topology: Topology, members: Bool[Array, " N"], gaussians: int) -> SizeRecord:
    points = topology.points[members].astype(np.float64)
    extent = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    return SizeRecord(
        points=len(points),
        gaussians=gaussians,
        mass=float(topology.mass[members].sum(dtype=np.float64)),
        extent=(float(extent[0]), float(extent[1]), float(extent[2])),
    )
