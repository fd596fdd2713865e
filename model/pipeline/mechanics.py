"""What is seen, and what it is made of → a twin that has not moved yet."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.controllers import find_controllers, grip_paths, read_controllers
from model.errors import InputError
from model.grip_choice import choose_grip
from model.manifest import describe_parts, with_metrics, write_manifest
from model.observe.tracks import observe_tracks
from model.pipeline.matter import Matter
from model.pipeline.methods import Methods
from model.pipeline.options import TwinOptions, fingerprint
from model.pipeline.sight import Sight
from model.predictor import ParameterPredictor, PriorMeanPredictor
from model.predictor.named import FILE
from model.skinning import bind
from model.stage_log import StageLog, Step
from model.timing import evenly_timed
from model.topology import build_topology
from model.tracking.queries import sample_queries
from model.types import Controllers, Parameters, Topology, Tracks

TRACK_COUNT = 300
"""Pixels of the object that are followed through the clip."""


def mechanise(
    sight: Sight, matter: Matter, options: TwinOptions, methods: Methods, log: StageLog
) -> TwinBundle:
    """The hand, the springs and their parameters → a bundle that has not moved yet."""
    tracker, predictor = methods.tracker, methods.predictor
    frames, masks, calibration = sight.frames, sight.masks, sight.calibration
    queries = sample_queries(sight.object_mask, TRACK_COUNT, options.seed)
    tracks = log.run("tracking", tracker, lambda: tracker(frames, queries, masks.keyframe))
    if options.controllers is not None:
        path = options.controllers
        controllers = log.run("controllers", Step("user", "1"), lambda: read_controllers(path, frames, masks))
    else:
        controllers = log.run(
            "controllers",
            Step("contact", "1"),
            lambda: find_controllers(frames, masks, tracks, calibration, sight.gaussians, tracker),
        )
    topology = log.run(
        "topology",
        Step("lattice", "1"),
        lambda: build_topology(
            sight.gaussians,
            matter.parts,
            matter.priors,
            sight.shape_class,
            controllers,
            bind=bind,
            point_count=options.points,
            seed=options.seed,
        ),
    )
    if options.controllers is not None:
        _check_hold(options.controllers, topology)
    first = log.run(
        "prior parameters",
        PriorMeanPredictor(),
        lambda: PriorMeanPredictor().from_priors(
            topology, matter.priors, sight.shape_class, calibration.gravity, calibration.ground_height
        ),
    )
    weights = predictor.weights if options.predictor.endswith(FILE) else None
    bundle = TwinBundle(
        manifest=write_manifest(frames, masks.keyframe, calibration, fingerprint(options, weights)),
        gaussians=sight.gaussians,
        topology=topology,
        parameters=first,
        parts=(),
    )
    if len(topology.controller_springs):
        paths = {"given": controllers} if options.controllers else grip_paths(controllers, calibration)
        bundle = _gripped(bundle, paths, sight, methods, log)
    parameters = log.run("parameters", predictor, lambda: _predict(bundle, sight, matter, tracks, predictor))
    described = describe_parts(matter.views, matter.priors, matter.parts, topology, parameters)
    return replace(bundle, parameters=parameters, parts=described)


def _check_hold(path: Path, topology: Topology) -> None:
    """Refuse a motion that moves nothing: it is meant to, so its world or its unit is another."""
    starts = topology.controller_points
    if len(starts) and not len(topology.controller_springs):
        nearest = float(cKDTree(topology.points).query(starts)[0].min())
        raise InputError(
            f"{path.name}: none of its {len(starts)} controllers starts at the object, the nearest is "
            f"{nearest:.3g} m from it: expected metres in the twin's world, which a --camera file fixes"
        )


def _gripped(
    bundle: TwinBundle, paths: Mapping[str, Controllers], sight: Sight, methods: Methods, log: StageLog
) -> TwinBundle:
    """The twin with the path of the hand that the clip speaks for."""
    frames, masks = sight.frames, sight.masks
    times = frames.times[masks.keyframe :]
    even = {name: evenly_timed(path.motion, times, frames.fps) for name, path in paths.items()}
    chosen = log.run(
        "grip",
        Step("replay", "1"),
        lambda: choose_grip(bundle, even, frames, masks, sight.calibration.camera, methods.renderer),
    )
    return replace(
        bundle, controls=chosen.controls, manifest=with_metrics(bundle.manifest, {"grip_path": chosen.name})
    )


def _predict(
    bundle: TwinBundle, sight: Sight, matter: Matter, tracks: Tracks, predictor: ParameterPredictor
) -> Parameters:
    """The mechanics, from the clip as a case; where that cannot be, what the bundle has already."""
    masks, key = sight.masks, sight.masks.keyframe
    times = sight.frames.times[key:] - sight.frames.times[key]
    camera = sight.calibration.camera
    try:
        case = observe_tracks(bundle, matter.priors, sight.shape_class, camera, tracks, masks, times)
        return predictor(case, sight.frames.images[key:])
    except InputError as error:
        doubt = f"the prior's means are used, not {predictor.name}: {error}"
        return replace(bundle.parameters, warnings=(*bundle.parameters.warnings, doubt))
