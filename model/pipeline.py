"""The only file that knows the order of the stages."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import get_args

from jaxtyping import Bool, UInt8
from pydantic import JsonValue

from model.bundle import TwinBundle
from model.controllers import find_controllers, grip_paths, read_controllers
from model.doubts import collect_doubts
from model.encoders import ALL_ENCODERS, SemanticEncoder
from model.errors import InputError
from model.gap.bodies.body import body_of
from model.gap.diagnosable import check_diagnosable
from model.gap.diagnosis import Diagnosis
from model.gap.given import given_twin
from model.gap.plain import PlainTwin
from model.gap.result import DiagnosisResult
from model.grip_choice import choose_grip
from model.lifting import lift_features, visible_gaussians
from model.manifest import describe_parts, write_manifest
from model.observation import read_observation
from model.observe.tracks import observe_tracks
from model.part_views import view_parts
from model.parts import segment_parts
from model.predictor import ParameterPredictor, PriorMeanPredictor
from model.predictor.named import predictor_named
from model.preview import preview
from model.priors import ALL_PRIORS
from model.priors.base import PriorClient
from model.prompt import read_prompt
from model.reconstruction import ALL_RECONSTRUCTORS, Reconstructor
from model.reconstruction.cameras import calibrate
from model.reconstruction.depth import DepthReconstructor
from model.reconstruction.mesh import MeshReconstructor
from model.registry import by_name
from model.rendering import ALL_RENDERERS, Renderer, best_renderer
from model.schema import BundleManifest
from model.segmentation import ALL_SEGMENTERS, Segmenter
from model.skinning import bind
from model.stage_log import StageLog, StageReport, Step
from model.timing import evenly_timed
from model.topology import build_topology
from model.tracking import ALL_TRACKERS, Tracker
from model.tracking.queries import sample_queries
from model.types import (
    Array,
    Calibration,
    Controllers,
    Frames,
    Gaussians,
    Masks,
    MaterialPrior,
    Observation,
    Parameters,
    Parts,
    PartView,
    ShapeClass,
    Tracks,
)
from model.video import read_video

SHARES = {
    "video": 1.0,
    "segmentation": 12.0,
    "shape": 0.2,
    "calibration": 1.0,
    "reconstruction": 4.0,
    "features": 2.0,
    "parts": 2.0,
    "prior": 1.0,
    "tracking": 4.0,
    "controllers": 1.0,
    "topology": 2.0,
    "prior parameters": 0.5,
    "grip": 6.0,
    "parameters": 6.0,
    "simulation": 10.0,
    "preview": 8.0,
}
"""What each stage roughly costs, for the progress bar alone."""

TRACK_COUNT = 300
"""Pixels of the object that are followed through the clip."""


@dataclass(frozen=True)
class TwinOptions:
    """What a user may choose; every field is an option of `matphys twin`."""

    mask: Path | None = None
    box: tuple[int, int, int, int] | None = None
    """x, y, width, height [px]."""
    keyframe: int | None = None
    camera: Path | None = None
    size_m: float | None = None
    """Largest extent of the object [m]."""
    mesh: Path | None = None
    depth: Path | None = None
    controllers: Path | None = None
    shape: str = "auto"
    prior: str = "stub"
    predictor: str = "matphys"
    """`matphys`: the trained one that comes with the package; a file: another one; `prior-mean`."""
    parts: int = 5
    points: int = 1500
    segmentation: str = "classical"
    tracking: str = "opencv"
    reconstruction: str | None = None
    """None: `mesh` with a mesh, `depth` with depth, else `silhouette`."""
    encoder: str = "texture"
    renderer: str | None = None
    """None: the fastest that runs here."""
    seed: int = 0


@dataclass(frozen=True)
class TwinResult:
    """A twin and what it cost."""

    bundle: TwinBundle
    seconds: Mapping[str, float]
    """Measured per stage; not in the bundle, whose bytes depend on its input alone."""


@dataclass(frozen=True)
class _Methods:
    """Who does what."""

    segmenter: Segmenter
    reconstructor: Reconstructor
    encoder: SemanticEncoder
    prior: PriorClient
    tracker: Tracker
    predictor: ParameterPredictor
    renderer: Renderer


@dataclass(frozen=True)
class _Sight:
    """What the keyframe and its surroundings tell."""

    frames: Frames
    masks: Masks
    shape_class: ShapeClass
    calibration: Calibration
    gaussians: Gaussians

    @property
    def keyframe(self) -> UInt8[Array, "H W 3"]:
        """The image the twin is reconstructed from."""
        image: UInt8[Array, "H W 3"] = self.frames.images[self.masks.keyframe]
        return image

    @property
    def object_mask(self) -> Bool[Array, "H W"]:
        """The object on the keyframe."""
        mask: Bool[Array, "H W"] = self.masks.object[self.masks.keyframe]
        return mask


@dataclass(frozen=True)
class _Matter:
    """What the object is made of."""

    parts: Parts
    views: list[PartView]
    priors: list[MaterialPrior]
    warnings: tuple[str, ...] = ()


def build_twin(video: Path, options: TwinOptions, report: StageReport) -> TwinResult:
    """Turn a clip into a simulatable twin.

    Args:
        video: A video file, or a folder of numbered images.
        options: What the user chose.
        report: Told which stage begins and how far the whole is.

    Raises:
        InputError: the clip or an option cannot be used; the message is one line for the user.
    """
    methods = _choose(options)
    log = StageLog(SHARES, report)
    sight = _see(video, options, methods, log)
    matter = _understand(sight, options, methods, log)
    bundle = _mechanise(sight, matter, options, methods, log)
    bundle = _replay(bundle, sight, methods.renderer, log)
    report("done", 1.0)
    return TwinResult(bundle, log.seconds)


def observe(
    video: Path,
    twin: Path,
    segmentation: str,
    tracking: str,
    mask: Path | None,
    report: StageReport,
    box: tuple[int, int, int, int] | None = None,
) -> Observation:
    """Say what really moved in a clip, as the twin of that clip sees it.

    Args:
        video: The clip.
        twin: Its twin.
        segmentation: Method that finds the object.
        tracking: Method that follows it.
        mask: The object on the keyframe, white on black.
        report: Told which stage begins and how far the whole is.
        box: Around the object on the keyframe, x, y, width, height [px].

    Raises:
        InputError: they do not belong together, or cannot be used; the message is one line.
    """
    from model.observe.clip import observe_clip

    segmenter = by_name(ALL_SEGMENTERS, segmentation, "segmentation")()
    tracker = by_name(ALL_TRACKERS, tracking, "tracking")()
    return observe_clip(video, TwinBundle.load(twin), segmenter, tracker, report, mask=mask, box=box)


def diagnose(
    observation: Path, twin: Path | None, transfer: Path | None, report: StageReport
) -> DiagnosisResult:
    """Say where a twin departs from what really moved, which effect it lacks, and how far the gap shrinks.

    Args:
        observation: What really moved.
        twin: What it is compared with; None: a plain twin made of the observation.
        transfer: A second interaction with the same object.
        report: Told which stage begins and how far the whole is.

    Raises:
        InputError: a file cannot be used, or they do not belong together; the message is one line.
    """
    from model.gap.diagnose import diagnose as find  # with a trained jury, which building a twin does without

    report("observation", 0.0)
    with collect_doubts() as doubts:
        seen = _diagnosable(observation)
        other = None if transfer is None else _diagnosable(transfer)
        bundle = None if twin is None else TwinBundle.load(twin)
        given = None if bundle is None else given_twin(bundle, seen)
        found = find(seen if given is None else given.observation, given, other, report)
    plain = given or PlainTwin.of(body_of(seen), seen)
    report("done", 1.0)
    return DiagnosisResult(_doubted(found, doubts), plain.observation, plain, bundle)


def _diagnosable(path: Path) -> Observation:
    observation = read_observation(path)
    check_diagnosable(observation, path.name)
    return observation


def _doubted(found: Diagnosis, doubts: Sequence[str]) -> Diagnosis:
    """The diagnosis with what its input gave reason to doubt among the warnings of its report."""
    report = found.findings.report
    said = tuple(dict.fromkeys([*report.warnings, *doubts]))
    findings = replace(found.findings, report=report.model_copy(update={"warnings": said}))
    return replace(found, findings=findings)


def _choose(options: TwinOptions) -> _Methods:
    """Look all methods up before any work, so that a wrong name costs no time."""
    return _Methods(
        segmenter=by_name(ALL_SEGMENTERS, options.segmentation, "segmentation")(),
        reconstructor=_reconstructor(options),
        encoder=by_name(ALL_ENCODERS, options.encoder, "encoder")(),
        prior=by_name(ALL_PRIORS, options.prior, "prior")(),
        tracker=by_name(ALL_TRACKERS, options.tracking, "tracking")(),
        predictor=predictor_named(options.predictor),
        renderer=by_name(ALL_RENDERERS, options.renderer, "renderer")()
        if options.renderer
        else best_renderer(),
    )


def _see(video: Path, options: TwinOptions, methods: _Methods, log: StageLog) -> _Sight:
    """Frames → masks → the metric world → Gaussians."""
    segmenter, reconstructor, prior = methods.segmenter, methods.reconstructor, methods.prior
    frames = log.run("video", Step("pyav", "1"), lambda: read_video(video))
    prompt = read_prompt(frames, mask=options.mask, box=options.box, keyframe=options.keyframe)
    masks = log.run("segmentation", segmenter, lambda: segmenter(frames, prompt))
    keyframe, mask = frames.images[masks.keyframe], masks.object[masks.keyframe]
    shape_class = log.run("shape", *_shape(options.shape, prior, PartView(keyframe, mask, mask, "object")))
    depth = DepthReconstructor(options.depth).keyframe_depth(frames, masks) if options.depth else None
    calibration = log.run(
        "calibration",
        Step("camera file" if options.camera else "image", "1"),
        lambda: calibrate(
            frames,
            masks,
            camera_file=options.camera,
            size_m=options.size_m,
            shape_class=shape_class,
            depth=depth,
        ),
    )
    gaussians = log.run(
        "reconstruction", reconstructor, lambda: reconstructor(frames, masks, calibration, shape_class)
    )
    return _Sight(frames, masks, shape_class, calibration, gaussians)


def _reconstructor(options: TwinOptions) -> Reconstructor:
    """The method the user named, or the one that what they gave is for."""
    name = options.reconstruction or ("mesh" if options.mesh else "depth" if options.depth else "silhouette")
    method = by_name(ALL_RECONSTRUCTORS, name, "reconstruction")
    if method is MeshReconstructor:
        return MeshReconstructor(_given(options.mesh, name))
    if method is DepthReconstructor:
        return DepthReconstructor(_given(options.depth, name))
    return method()


def _given(path: Path | None, name: str) -> Path:
    if path is None:
        raise InputError(f"--reconstruction {name} needs --{name} PATH")
    return path


def _shape(
    wanted: str, prior: PriorClient, view: PartView
) -> tuple[Step | PriorClient, Callable[[], ShapeClass]]:
    """Who says whether it is a sheet, a rope or a solid: the user, or the prior on seeing the whole."""
    if wanted == "auto":
        return prior, lambda: prior.material(view).shape_class
    known = {shape_class: shape_class for shape_class in get_args(ShapeClass)}
    if wanted not in known:
        raise InputError(f"--shape {wanted}: choose one of auto, {', '.join(known)}")
    return Step("user", "1"), lambda: known[wanted]


def _understand(sight: _Sight, options: TwinOptions, methods: _Methods, log: StageLog) -> _Matter:
    """Gaussians → features → parts → what each is made of."""
    encoder, prior = methods.encoder, methods.prior
    camera, gaussians = sight.calibration.camera, sight.gaussians
    features = log.run(
        "features",
        encoder,
        lambda: lift_features(encoder(sight.keyframe), gaussians, camera, sight.object_mask),
    )
    parts = log.run(
        "parts",
        Step("normalised cuts", "1"),
        lambda: segment_parts(gaussians, features, options.parts, options.seed),
    )
    visible = visible_gaussians(gaussians, camera, sight.object_mask)
    views = view_parts(
        sight.keyframe, sight.object_mask, gaussians, parts, visible, camera, sight.shape_class
    )
    return log.run("prior", prior, lambda: _believe(prior, parts, views))


def _believe(prior: PriorClient, parts: Parts, views: list[PartView]) -> _Matter:
    priors = [prior.material(view) for view in views]
    warnings = dict.fromkeys(warning for belief in priors for warning in belief.warnings)
    return _Matter(parts, views, priors, tuple(warnings))


def _mechanise(
    sight: _Sight, matter: _Matter, options: TwinOptions, methods: _Methods, log: StageLog
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
    first = log.run(
        "prior parameters",
        PriorMeanPredictor(),
        lambda: PriorMeanPredictor().from_priors(
            topology, matter.priors, sight.shape_class, calibration.gravity, calibration.ground_height
        ),
    )
    bundle = TwinBundle(
        manifest=write_manifest(frames, masks.keyframe, calibration, _fingerprint(options)),
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


def _gripped(
    bundle: TwinBundle, paths: Mapping[str, Controllers], sight: _Sight, methods: _Methods, log: StageLog
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
        bundle, controls=chosen.controls, manifest=_with_metrics(bundle, {"grip_path": chosen.name})
    )


def _predict(
    bundle: TwinBundle, sight: _Sight, matter: _Matter, tracks: Tracks, predictor: ParameterPredictor
) -> Parameters:
    """The mechanics, from the clip as a case; where it shows no motion, what the bundle has already."""
    masks, key = sight.masks, sight.masks.keyframe
    times = sight.frames.times[key:] - sight.frames.times[key]
    camera = sight.calibration.camera
    try:
        case = observe_tracks(bundle, matter.priors, sight.shape_class, camera, tracks, masks, times)
        return predictor(case, sight.frames.images[key:])
    except InputError as error:
        doubt = f"parameters: the prior's means are used, for the motion says nothing: {error}"
        return replace(bundle.parameters, warnings=(*bundle.parameters.warnings, doubt))


def _with_metrics(bundle: TwinBundle, metrics: dict[str, JsonValue]) -> BundleManifest:
    return bundle.manifest.model_copy(update={"metrics": {**bundle.manifest.metrics, **metrics}})


def _replay(bundle: TwinBundle, sight: _Sight, renderer: Renderer, log: StageLog) -> TwinBundle:
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
    manifest = _with_metrics(bundle, metrics).model_copy(
        update={"stages": tuple(log.records), "warnings": tuple(log.warnings)}
    )
    return replace(bundle, manifest=manifest, preview=shown.video)


def _fingerprint(options: TwinOptions) -> dict[str, JsonValue]:
    """The options as JSON, files by their content: what makes one twin another."""

    def plain(value: object) -> JsonValue:
        if isinstance(value, Path):
            files = sorted(file for file in value.rglob("*") if file.is_file()) if value.is_dir() else [value]
            return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
        if isinstance(value, tuple):
            return list(value)
        assert value is None or isinstance(value, str | int | float)
        return value

    return {name: plain(value) for name, value in asdict(options).items()}
