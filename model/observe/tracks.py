"""Tracks of a clip and the twin made so far → a case, as predictors read them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import gravity, ground_height
from model.lifting import visible_gaussians
from model.observe.lift import controllers_at, inside_masks, lift
from model.scenes.anchors import anchor
from model.scenes.case import Case
from model.scenes.replay import observed
from model.types import Array, Camera, Masks, MaterialPrior, Observation, ShapeClass, Tracks


def observe_tracks(
    twin: TwinBundle,
    priors: Sequence[MaterialPrior],
    shape_class: ShapeClass,
    camera: Camera,
    tracks: Tracks,
    masks: Masks,
    times: Float64[Array, " T"],
) -> Case:
    """Lift the tracks of a clip onto a twin that has its hand but not yet its parameters.

    A track starts at the depth of the nearest Gaussian that is seen beside it on the keyframe, and hangs on
    the mass points there. Later it is as deep as the twin, without contact with itself, has that point: one
    camera says nothing about motion along its line of sight.

    Args:
        twin: Points, springs, first parameters and the motion of the hand, if there is one.
        priors: One per part.
        shape_class: Sheet, rope or solid.
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
    observation = Observation(
        times=times,
        points=points,
        controllers=controls,
        ground_height=ground_height(twin.parameters),
        gravity=gravity(twin.parameters),
    )
    name = twin.manifest.source.name or "clip"
    return Case(
        name=name,
        object_name=name,
        object_class="unknown",
        interaction="unknown",
        shape_class=shape_class,
        topology=twin.topology,
        priors=tuple(priors),
        observation=observation,
        rest=rest.astype(np.float32),
        anchors=anchors,
        split=len(times),
        camera=camera,
        gaussians=twin.gaussians,
    )


def _free(twin: TwinBundle) -> TwinBundle:
    """The twin without self-contact, which costs more than depth is worth."""
    lone = {name: value for name, value in twin.parameters.globals.items() if name != "collision_distance"}
    return replace(twin, parameters=replace(twin.parameters, globals=lone))
