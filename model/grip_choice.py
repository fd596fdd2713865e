"""Which of several paths of the hand the clip speaks for: the one whose replay covers the object best."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Int

from model.bundle import TwinBundle
from model.preview import frame_overlap, matched_frames, render_rollout
from model.rendering.base import Renderer
from model.simulator.divergence import SimulationDiverged
from model.types import Array, Camera, Frames, Masks
from model.views import scaled

LOOKS = 10
"""Moments at which each replay is compared with the clip."""
SIDE = 240
"""Longest side of the pictures that are compared [px]."""
CLEAR = 0.01
"""By how much silhouette IoU another path must win over the first."""


@dataclass(frozen=True)
class GripChoice:
    """The path that was taken."""

    name: str
    controls: Float32[Array, "T C 3"]
    overlap: Mapping[str, float]
    """Mean silhouette IoU of each path's replay at the moments looked at."""
    warnings: tuple[str, ...] = ()


def choose_grip(
    twin: TwinBundle,
    paths: Mapping[str, Float32[Array, "T C 3"]],
    frames: Frames,
    masks: Masks,
    camera: Camera,
    renderer: Renderer,
) -> GripChoice:
    """Replay the twin along each path, without self-collision, and compare silhouettes.

    One view does not show how far away the hand is; what the object does under it tells. The first path is
    kept unless another is clearly better.

    Args:
        twin: A twin that has not been replayed; only its controls change.
        paths: Motions of its controllers [m] by name, the first being the default.
        frames: The clip.
        masks: What is compared with.
        camera: Of the clip.
        renderer: What draws the silhouettes.
    """
    first = next(iter(paths))
    if len(paths) == 1:
        return GripChoice(first, paths[first], {})
    lone = {name: value for name, value in twin.parameters.globals.items() if name != "collision_distance"}
    free = replace(twin, parameters=replace(twin.parameters, globals=lone))
    small = scaled(camera, SIDE)
    scores = {
        name: _score(free, controls, frames, masks, small, renderer) for name, controls in paths.items()
    }
    best = max(scores, key=lambda name: scores[name])
    if scores[best] < scores[first] + CLEAR:
        best = first
    return GripChoice(best, paths[best], scores)


def _score(
    twin: TwinBundle,
    controls: Float32[Array, "T C 3"],
    frames: Frames,
    masks: Masks,
    camera: Camera,
    renderer: Renderer,
) -> float:
    try:
        trajectory = twin.rollout(controls)
    except SimulationDiverged:
        return 0.0
    clip_frames, moments = matched_frames(frames.times, masks.keyframe, trajectory.times)
    looks: Int[Array, " L"] = np.unique(np.linspace(0, len(moments) - 1, LOOKS).round().astype(int))
    positions = trajectory.points[moments[looks]]
    rollout = render_rollout(twin.gaussians, twin.topology, positions, camera, renderer)
    overlaps = [
        frame_overlap(shown.alpha, masks, int(frame), camera)
        for shown, frame in zip(rollout, clip_frames[looks], strict=True)
    ]
    return float(np.mean(overlaps))
