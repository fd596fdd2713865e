"""What was seen of an object's motion → features on the mass points of its twin."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float32, Int, UInt8
from scipy.spatial import cKDTree

from model.encoders.motion import EncodedMotion, MotionClip, MotionEncoder
from model.errors import InputError
from model.predictor.motion_features import MotionFeatures
from model.predictor.reference import compared_frames, reference_motion
from model.scenes.case import Anchors
from model.types import Array, Camera, Observation, ShapeClass, Topology

NEAREST = 5
"""Observed points whose features a mass point takes the mean of."""
LEAST_SEEN = 3
"""Frames in which a point must have been seen to say something about its surroundings."""


def describe_motion(
    topology: Topology,
    shape_class: ShapeClass,
    rest: Float32[Array, "N 3"],
    anchors: Anchors,
    observation: Observation,
    camera: Camera | None,
    frames: int,
    encoder: MotionEncoder,
    images: UInt8[Array, "T H W 3"] | None = None,
) -> MotionFeatures:
    """Describe the first `frames` frames; nothing later is looked at.

    Args:
        topology: The twin's, at rest in frame 0.
        shape_class: Sheet, rope or solid.
        rest: The observed points in frame 0 [m], seen or not.
        anchors: Which mass points they hang on.
        observation: What was seen; NaN where it was not.
        camera: The only view, where there is one; None: points were measured in space.
        frames: At least 4.
        encoder: What describes them.
        images: RGB frames of that camera, for an encoder that looks at them.

    Raises:
        InputError: fewer than 4 frames, or the encoder needs what is not given.
    """
    if not 4 <= frames <= len(observation.times):
        raise InputError(
            f"motion: {frames} frames to look at: expected at least 4 of the {len(observation.times)}"
        )
    seen = _first(observation, frames)
    part = topology.part[np.take_along_axis(anchors.index, anchors.weight.argmax(axis=1)[:, None], axis=1)][
        :, 0
    ]
    references = None
    if encoder.needs_references:
        compared = _first(seen, compared_frames(len(topology.springs), frames))
        references = reference_motion(topology, shape_class, anchors, compared, camera)
    clip = MotionClip(
        times=seen.times,
        rest=rest,
        points=seen.points,
        part=part,
        parts=int(topology.part.max()) + 1,
        controllers=seen.controllers,
        gravity=seen.gravity,
        camera=camera,
        references=references,
        images=None if images is None else images[:frames],
    )
    counted = np.isfinite(seen.points).all(axis=-1).sum(axis=0) >= LEAST_SEEN
    return _lift(encoder(clip), topology, rest, part, counted)


def _first(observation: Observation, frames: int) -> Observation:
    return replace(
        observation,
        times=observation.times[:frames],
        points=observation.points[:frames],
        controllers=observation.controllers[:frames],
    )


def _lift(
    encoded: EncodedMotion,
    topology: Topology,
    rest: Float32[Array, "N 3"],
    part: Int[Array, " N"],
    counted: Bool[Array, " N"],
) -> MotionFeatures:
    """Each mass point takes the features of its part, and the mean of the nearest observed points' ones.

    Weights fall off with the distance; points of the same part come first.
    """
    points = np.zeros((len(topology.points), encoded.points.shape[1]), np.float32)
    for number in range(len(encoded.parts)):
        mine = np.flatnonzero(topology.part == number)
        source = np.flatnonzero(counted & (part == number))
        if len(source) < NEAREST:
            source = np.flatnonzero(counted)
        if not len(source) or not len(mine):
            continue
        count = min(NEAREST, len(source))
        distance, index = cKDTree(rest[source]).query(topology.points[mine], count)
        weight = 1.0 / (distance.reshape(-1, count) + 1e-3)
        weight /= weight.sum(axis=1, keepdims=True)
        found = encoded.points[source][index.reshape(-1, count)]
        points[mine] = (found * weight[..., None]).sum(axis=1)
    together = np.concatenate([points, encoded.parts[topology.part]], axis=1).astype(np.float32)
    return MotionFeatures(together, encoded.whole)
