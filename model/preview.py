"""A twin in motion, as a picture: beside its clip, or alone; and how well the silhouettes agree."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, Int, UInt8

from model.backdrops import plate, shade, studio
from model.formats.files import replacing
from model.formats.movie import encode_mp4
from model.rendering.base import Renderer
from model.skinning import Skin
from model.types import Array, Calibration, Camera, Frames, Gaussians, Masks, Topology, Trajectory
from model.views import overview, scaled

if TYPE_CHECKING:
    from model.bundle import TwinBundle

PANEL = 640
"""Longest side of one picture in the preview [px]."""
SOLID = 0.5
"""From this alpha on, a pixel belongs to the twin's silhouette."""


@dataclass(frozen=True)
class TwinFrame:
    """The twin at one moment, as a camera sees it."""

    color: Float32[Array, "H W 3"]
    """Premultiplied by alpha, 0..1."""
    alpha: Float32[Array, "H W"]
    means: Float32[Array, "G 3"]
    """Where the Gaussians are [m]."""


@dataclass(frozen=True)
class Preview:
    """The clip beside the replayed twin."""

    video: bytes
    """An MP4."""
    overlap: Float64[Array, " F"]
    """Silhouette IoU of every frame from the keyframe on, where the hand hides nothing."""


def render_rollout(
    gaussians: Gaussians,
    topology: Topology,
    positions: Float32[Array, "T N 3"],
    camera: Camera,
    renderer: Renderer,
) -> Iterator[TwinFrame]:
    """Render the twin with its points at each of `positions` [m], one frame at a time."""
    skin = Skin(gaussians, topology)
    scales, opacities, colors = (
        torch.as_tensor(array) for array in (gaussians.scales, gaussians.opacities, gaussians.visible_colors)
    )
    for points in positions:
        with torch.no_grad():
            means, quaternions = skin(torch.as_tensor(points))
            image = renderer(means, scales, quaternions, opacities, colors, camera)
        yield TwinFrame(image.color.numpy(), image.alpha.numpy(), means.numpy())


def silhouette_iou(
    alpha: Float32[Array, "H W"], mask: Bool[Array, "H W"], hidden: Bool[Array, "H W"]
) -> float:
    """Intersection over union of the twin's silhouette and the object's mask.

    Pixels that are `hidden` (behind the hand) count on neither side. Nothing on both sides is agreement.
    """
    drawn, there = (alpha > SOLID) & ~hidden, mask & ~hidden
    union = int((drawn | there).sum())
    return float((drawn & there).sum()) / union if union else 1.0


def preview(
    frames: Frames,
    masks: Masks,
    calibration: Calibration,
    gaussians: Gaussians,
    topology: Topology,
    trajectory: Trajectory,
    controls: Float32[Array, "T C 3"] | None,
    renderer: Renderer,
) -> Preview:
    """Put the clip beside the replayed twin, seen by the same camera over the same scene, dimmed.

    Args:
        frames: The clip.
        masks: Object and hand.
        calibration: The camera, and the ground if there is one.
        gaussians: The twin at rest.
        topology: Its points and bindings.
        trajectory: The replay; its frame 0 is the keyframe.
        controls: Where the hand holds it over time [m], for marks; as many frames as the trajectory.
        renderer: What draws it.
    """
    camera = scaled(calibration.camera, PANEL)
    backdrop = plate(frames, masks, camera.width, camera.height)
    clip_frames, rollout_frames = matched_frames(frames.times, masks.keyframe, trajectory.times)
    rollout = render_rollout(gaussians, topology, trajectory.points[rollout_frames], camera, renderer)
    overlap: list[float] = []

    def pictures() -> Iterator[UInt8[Array, "h w 3"]]:
        for clip_frame, moment, twin in zip(clip_frames, rollout_frames, rollout, strict=True):
            overlap.append(frame_overlap(twin.alpha, masks, int(clip_frame), camera))
            picture = _composed(twin, backdrop, calibration.ground_height, gaussians, camera)
            if controls is not None:
                picture = _marked(picture, controls[moment], camera)
            size = (camera.width, camera.height)
            original = cv2.resize(frames.images[clip_frame], size, interpolation=cv2.INTER_AREA)
            yield np.hstack([_labelled(original, "clip"), _labelled(picture, "twin")])

    video = encode_mp4(pictures(), frames.times[clip_frames])
    return Preview(video, np.array(overlap))


def write_rollout_video(path: Path, bundle: "TwinBundle", trajectory: Trajectory, renderer: Renderer) -> None:
    """Write an MP4 of the twin alone, in a plain studio.

    The camera is the clip's where the bundle knows it, else one in front of the motion and slightly
    above. The file is written whole or not at all.

    Raises:
        InputError: nothing can be written at `path`.
    """
    camera = scaled(bundle.camera or overview(trajectory.points), PANEL)
    parameter = bundle.parameters.globals.get("ground_height")
    ground = None if parameter is None else float(np.asarray(parameter.value))
    backdrop = studio(camera, ground)
    rollout = render_rollout(bundle.gaussians, bundle.topology, trajectory.points, camera, renderer)
    pictures = (_composed(twin, backdrop, ground, bundle.gaussians, camera) for twin in rollout)
    with replacing(path) as temporary:
        temporary.write_bytes(encode_mp4(pictures, trajectory.times))


def matched_frames(
    clip_times: Float64[Array, " T"], keyframe: int, rollout_times: Float64[Array, " R"]
) -> tuple[Int[Array, " F"], Int[Array, " F"]]:
    """Frames of the clip within the replay's time, and the frame of the replay nearest to each."""
    since = clip_times - clip_times[keyframe]
    step = float(np.median(np.diff(clip_times))) if len(clip_times) > 1 else 1.0
    clip_frames = np.flatnonzero((since >= 0) & (since <= rollout_times[-1] + step / 2))
    after = np.searchsorted(rollout_times, since[clip_frames]).clip(1, max(len(rollout_times) - 1, 1))
    if len(rollout_times) == 1:
        return clip_frames, np.zeros_like(clip_frames)
    middle = (rollout_times[after - 1] + rollout_times[after]) / 2
    return clip_frames, np.where(since[clip_frames] <= middle, after - 1, after)


def frame_overlap(alpha: Float32[Array, "h w"], masks: Masks, frame: int, camera: Camera) -> float:
    """Silhouette IoU on one frame of the clip, where the hand hides nothing, at the size of `camera`."""
    size = (camera.width, camera.height)
    thing, hand = (
        cv2.resize(mask[frame].astype(np.float32), size, interpolation=cv2.INTER_AREA) > SOLID
        for mask in (masks.object, masks.hand)
    )
    return silhouette_iou(alpha, thing, hand)


def _composed(
    twin: TwinFrame,
    backdrop: Float32[Array, "h w 3"],
    ground_height: float | None,
    gaussians: Gaussians,
    camera: Camera,
) -> UInt8[Array, "h w 3"]:
    """The twin over its backdrop, with its shadow if there is a ground."""
    behind = backdrop
    if ground_height is not None:
        behind = shade(backdrop, twin.means, gaussians.volumes, ground_height, camera)
    picture = twin.color + (1 - twin.alpha)[..., None] * behind
    composed: UInt8[Array, "h w 3"] = (picture.clip(0, 1) * 255 + 0.5).astype(np.uint8)
    return composed


def _marked(
    picture: UInt8[Array, "h w 3"], controllers: Float32[Array, "C 3"], camera: Camera
) -> UInt8[Array, "h w 3"]:
    """The picture with a small ring where each controller is."""
    pixels, depth = camera.project(controllers)
    overlay = picture.copy()
    for (x, y), z in zip(pixels, depth, strict=True):
        if z > 0 and abs(x) < 1e4 and abs(y) < 1e4:
            center = (round(x * 16), round(y * 16))
            cv2.circle(overlay, center, 4 * 16, (255, 255, 255), -1, cv2.LINE_AA, 4)
            cv2.circle(overlay, center, 3 * 16, (235, 80, 40), -1, cv2.LINE_AA, 4)
    blended: UInt8[Array, "h w 3"] = cv2.addWeighted(overlay, 0.7, picture, 0.3, 0)
    return blended


def _labelled(picture: UInt8[Array, "h w 3"], text: str) -> UInt8[Array, "h w 3"]:
    """The picture with a word in its upper left corner."""
    picture = picture.copy()
    for color, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(picture, text, (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.55, color, thickness, cv2.LINE_AA)
    return picture
