"""Tracks of a clip and the twin made so far → what its points were seen doing."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float32, Float64
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import gravity, ground_height
from model.lifting import visible_gaussians
from model.observe.lift import controllers_at, inside_masks, lift
from model.scenes.anchors import anchor
from model.scenes.case import Anchors
from model.scenes.replay import observed
from model.types import Array, Camera, Masks, Observation, Tracks


@dataclass(frozen=True)
class SeenMotion:
    """What a predictor gets to know of the motion in a clip, from the keyframe on."""

    observation: Observation
    rest: Float32[Array, "N 3"]
    """Where the observed points are on the keyframe [m]."""
    anchors: Anchors
    """The mass points that each of them hangs on."""
    camera: Camera
    """What saw it: the depth of the points is the twin's."""


def observe_tracks(
    twin: TwinBundle, camera: Camera, tracks: Tracks, masks: Masks, times: Float64[Array, " T"]
) -> SeenMotion:
    """Lift the tracks of a clip onto a twin that has its hand but not yet its parameters.

    A track starts at the depth of the nearest Gaussian that is seen beside it on the keyframe, and hangs on
    the mass points there. Later it is as deep as the twin, without contact with itself, has that point: one
    camera says nothing about motion along its line of sight.

    Args:
        twin: Points, springs, first parameters and the motion of the hand, if there is one.
        camera: Of the clip.
        tracks: Of points of the object, through all frames [px].
        masks: Object and hand in all frames.
        times: Of the frames from the keyframe on [s], the first being 0.

    Raises:
        InputError: nothing of the twin is seen inside the mask on the keyframe.
        SimulationDiverged: the twin cannot be rolled out.
    """
    key = masks.keyframe
    seen = np.flatnonzero(visible_gaussians(twin.gaussians, camera, masks.object[key]))
    if not len(seen):
        raise InputError("no point of the twin is seen on the object on the keyframe")
    queries = tracks.points[key]
    pixels, depth = camera.project(twin.gaussians.means[seen])
    nearest = cKDTree(pixels).query(queries)[1]
    rest = camera.unproject(queries, depth[nearest])
    anchors = anchor(rest, twin.topology.points, twin.topology.springs)
    controls = controllers_at(twin, times)
    trajectory = _free(twin).rollout(controls if controls.shape[1] else None, times=times)
    moved = observed(anchors, torch.as_tensor(trajectory.points)).numpy()
    shown = slice(key, key + len(times))
    points = lift(camera, tracks.points[shown], moved)
    points[~(tracks.visible[shown] & inside_masks(masks.object[shown], tracks.points[shown]))] = np.nan
    return SeenMotion(
        Observation(
            times=times,
            points=points,
            controllers=controls,
            ground_height=ground_height(twin.parameters),
            gravity=gravity(twin.parameters),
        ),
        rest.astype(np.float32),
        anchors,
        camera,
    )


def _free(twin: TwinBundle) -> TwinBundle:
    """The twin without self-contact, which costs more than depth is worth."""
    lone = {name: value for name, value in twin.parameters.globals.items() if name != "collision_distance"}
    return replace(twin, parameters=replace(twin.parameters, globals=lone))
