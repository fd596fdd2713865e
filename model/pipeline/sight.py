"""A clip → what is seen in it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

from jaxtyping import Bool, UInt8

from model.errors import InputError
from model.pipeline.methods import Methods
from model.pipeline.options import TwinOptions
from model.priors.base import PriorClient
from model.prompt import read_prompt
from model.reconstruction.cameras import calibrate
from model.reconstruction.depth import DepthReconstructor
from model.segmentation import Segmenter
from model.stage_log import StageLog, Step
from model.types import Array, Calibration, Frames, Gaussians, Masks, PartView, Prompt, ShapeClass
from model.video import read_video


@dataclass(frozen=True)
class Sight:
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


def see(video: Path, options: TwinOptions, methods: Methods, log: StageLog) -> Sight:
    """Frames → masks → the metric world → Gaussians."""
    segmenter, reconstructor, prior = methods.segmenter, methods.reconstructor, methods.prior
    frames = log.run("video", Step("pyav", "1"), lambda: read_video(video, fps=options.fps))
    prompt = read_prompt(frames, mask=options.mask, box=options.box, keyframe=options.keyframe)
    masks = log.run("segmentation", segmenter, lambda: _segmented(segmenter, frames, prompt))
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
            extent=lambda world: reconstructor.extent(frames, masks, world, shape_class),
            depth=depth,
            shape_from_depth=isinstance(reconstructor, DepthReconstructor),
        ),
    )
    gaussians = log.run(
        "reconstruction", reconstructor, lambda: reconstructor(frames, masks, calibration, shape_class)
    )
    return Sight(frames, masks, shape_class, calibration, gaussians)


def _segmented(segmenter: Segmenter, frames: Frames, prompt: Prompt) -> Masks:
    """The masks, with what is doubtful about the prompt among their warnings."""
    masks = segmenter(frames, prompt)
    return replace(masks, warnings=prompt.warnings + masks.warnings)


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
