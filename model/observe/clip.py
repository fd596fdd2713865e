"""A clip and its twin → an observation: 2D tracks, lifted to the depth at which the twin has each point."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, Int, Int64

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import gravity, ground_height
from model.lifting import visible_gaussians
from model.observation import checked
from model.observe.lift import controllers_at, inside_masks, lift
from model.prompt import read_prompt
from model.segmentation import Segmenter
from model.skinning import Skin
from model.stage_log import StageReport
from model.tracking import Tracker
from model.types import Array, Camera, Frames, Masks, Observation, Tracks
from model.video import read_video

POINTS = 180
"""Points of the object that are followed."""


def observe_clip(
    video: Path,
    twin: TwinBundle,
    segmenter: Segmenter,
    tracker: Tracker,
    report: StageReport,
    *,
    mask: Path | None = None,
    box: tuple[int, int, int, int] | None = None,
    fps: float | None = None,
) -> Observation:
    """Observe what moved in the clip that a twin was made from, from the twin's keyframe on.

    Args:
        video: The clip.
        twin: Its twin, with camera and keyframe.
        segmenter: Finds object and hand.
        tracker: Follows points in the image.
        report: Told which stage begins and how far the whole is.
        mask: The object on the keyframe, as for `matphys twin`.
        box: A box around it [px].
        fps: Frame rate of a clip that is a folder of images [1/s].

    Raises:
        InputError: the twin has no camera, or clip and twin do not fit each other.
    """
    camera = twin.camera
    if camera is None:
        raise InputError(
            "twin.json: source.camera is missing: points of the image cannot be lifted without it"
        )
    report("video", 0.0)
    frames = read_video(video, fps=fps)
    _check_same(frames, twin)
    report("segmentation", 0.1)
    keyframe = twin.manifest.source.keyframe or 0  # counts the frames that were kept, as here
    prompt = read_prompt(frames, mask=mask, box=box, keyframe=frames.number(keyframe))
    masks = segmenter(frames, prompt)
    chosen, queries = choose_points(twin, camera, masks.object[keyframe])
    report("tracking", 0.6)
    tracks = tracker(frames, queries, keyframe)
    report("simulation", 0.8)
    times = frames.times[keyframe:] - frames.times[keyframe]
    observation = checked(lift_tracks(twin, camera, chosen, tracks, masks, times), frames.name)
    report("done", 1.0)
    return observation


def _check_same(frames: Frames, twin: TwinBundle) -> None:
    source = twin.manifest.source
    if source.sha256 is not None and source.sha256 != frames.sha256:
        if source.frames is not None and source.frames != len(frames.images):
            raise InputError(
                f"{frames.name}: expected the clip that the twin was made from, of {source.frames} frames, "
                f"found another one, of {len(frames.images)}: the twin's hand moved as in its own clip"
            )
        warnings.warn(f"{frames.name} is not the clip that the twin was made from", stacklevel=3)
    if source.fps is not None and abs(frames.fps - source.fps) > 0.01 * source.fps:
        rates = f"{frames.fps:.3g} frames per second here, {source.fps:.3g} in the twin"
        warnings.warn(f"{frames.name}: {rates}; of a folder of images --fps says how many", stacklevel=3)
    if source.keyframe is not None and source.keyframe >= len(frames.images) - 1:
        found = f"found {len(frames.images)} frames and keyframe {source.keyframe}"
        raise InputError(f"{frames.name}: expected the clip to go on after the keyframe of the twin, {found}")


def choose_points(
    twin: TwinBundle, camera: Camera, mask: Bool[Array, "H W"]
) -> tuple[Int[Array, " N"], Float32[Array, "N 2"]]:
    """Gaussians seen on the keyframe, spread over the object, and where they are in the image [px].

    Args:
        twin: The twin.
        camera: Its camera.
        mask: The object on the keyframe.

    Raises:
        InputError: nothing of the twin is seen inside the mask.
    """
    fitted = _fitted(camera, mask.shape)
    seen = np.flatnonzero(visible_gaussians(twin.gaussians, fitted, mask))
    if not len(seen):
        raise InputError(
            "no point of the twin is seen on the object in the clip: is it the clip of this twin?"
        )
    chosen = seen[_spread(twin.gaussians.means[seen], POINTS)]
    pixels, _ = fitted.project(twin.gaussians.means[chosen])
    return chosen, pixels.astype(np.float32)


def lift_tracks(
    twin: TwinBundle,
    camera: Camera,
    chosen: Int[Array, " N"],
    tracks: Tracks,
    masks: Masks,
    times: Float64[Array, " T"],
) -> Observation:
    """Lift tracks from the keyframe on; a point is seen where its track is, inside the object's mask.

    One camera says nothing of the motion along its line of sight: there a point moves as the twin does.

    Args:
        twin: The twin, which is rolled out under its recorded hand.
        camera: Its camera.
        chosen: Gaussian of each track.
        tracks: Through all frames of the clip [px of the frames].
        masks: Object and hand in all frames.
        times: Since the keyframe [s].
    """
    key = masks.keyframe
    fitted = _fitted(camera, masks.object.shape[1:])
    count = len(times)
    controllers = controllers_at(twin, times)
    held = controllers if controllers.shape[1] else None
    moved = twin.rollout(held, times=times).points
    carried = _carried(twin, chosen, moved)
    pixels = tracks.points[key : key + count]
    points = lift(fitted, pixels, carried)
    seen = tracks.visible[key : key + count] & inside_masks(masks.object[key : key + count], pixels)
    points[~seen] = np.nan
    warnings.warn(
        "depth comes from the twin: what differs along the line of sight cannot be seen by one camera",
        stacklevel=2,
    )
    return Observation(
        times=times,
        points=points,
        controllers=controllers,
        ground_height=ground_height(twin.parameters),
        gravity=gravity(twin.parameters),
        colors=(twin.gaussians.visible_colors[chosen] * 255.0).round().astype(np.uint8),
        parts=_parts(twin, chosen),
    )


def _parts(twin: TwinBundle, chosen: Int[Array, " N"]) -> Int64[Array, " N"] | None:
    """Part of each chosen Gaussian, that of the mass point that moves it most; None: there is one alone."""
    topology = twin.topology
    nearest = topology.binding_weight[chosen].argmax(axis=1)
    part = topology.part[topology.binding_index[chosen, nearest]].astype(np.int64)
    return part if len(np.unique(part)) > 1 else None


def _carried(
    twin: TwinBundle, chosen: Int[Array, " N"], moved: Float32[Array, "T M 3"]
) -> Float32[Array, "T N 3"]:
    """Where the chosen Gaussians are when the mass points are at `moved` [m]."""
    skinning = Skin(twin.gaussians, twin.topology)
    with torch.no_grad():
        means = [skinning(torch.as_tensor(frame))[0].numpy()[chosen] for frame in moved]
    return np.stack(means).astype(np.float32)


def _fitted(camera: Camera, size: Sequence[int]) -> Camera:
    """The camera for frames of another size [H, W]; pixel centres are whole numbers."""
    height, width = int(size[0]), int(size[1])
    intrinsics = camera.intrinsics.copy()
    for row, factor in enumerate((width / camera.width, height / camera.height)):
        intrinsics[row, :2] *= factor
        intrinsics[row, 2] = (intrinsics[row, 2] + 0.5) * factor - 0.5
    return Camera(intrinsics, camera.world_from_camera, width, height)


def _spread(points: Float32[Array, "n 3"], count: int) -> Int[Array, " m"]:
    """Indices of at most `count` points, each far from those before (farthest-point sampling)."""
    taken = [0]
    distance = np.full(len(points), np.inf)
    while len(taken) < min(count, len(points)):
        distance = np.minimum(distance, ((points - points[taken[-1]]) ** 2).sum(axis=1))
        taken.append(int(distance.argmax()))
    return np.array(taken)
