"""The default segmenter: colour, saliency, flow and cuts; nothing to download."""

from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from model.errors import InputError
from model.segmentation.background import Contrast, camera_rests, textures
from model.segmentation.base import Segmenter
from model.segmentation.color_model import to_lab
from model.segmentation.keyframe import find_object, hand_regions, object_in_box, refined, settle
from model.segmentation.propagation import propagate
from model.segmentation.regions import grown, touching, without_specks
from model.segmentation.skin import SkinModel
from model.types import Array, Frames, Masks, Prompt

SMALL_SIDE = 424
"""Longest side of the pictures in which we search [px]."""


class ClassicalSegmenter(Segmenter):
    """Skin by colour, the object by what stands out near it, both carried through time by optical flow."""

    name: ClassVar[str] = "classical"
    version: ClassVar[str] = "1"

    def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
        """Segment the clip; see the base class."""
        height, width = frames.images.shape[1:3]
        check_prompt(prompt, len(frames.images), height, width)
        small = shrink(frames.images, SMALL_SIDE)
        labs = to_lab(small)
        sample = np.linspace(0, len(small) - 1, 8).round().astype(int)
        skin = SkinModel(small[sample], np.ones(small.shape[1:3], bool))
        hands = np.stack([hand_regions(skin(image)) for image in small])
        resting = camera_rests(small)
        keyframe, seed = _seed(labs, hands, prompt, resting)
        seed, hands[keyframe] = settle(seed, hands[keyframe])
        objects = propagate(small, hands, seed, keyframe)
        if resting:
            rough, texture = objects, textures(frames.images, small.shape[2], small.shape[1])
            for again in (False, True, True):
                contrast = Contrast.guess(small, texture, objects | rough, hands)
                if again:
                    contrast = contrast.learned(small, texture, objects, hands)
                else:
                    hands = _changed(hands, labs, texture, contrast)
                seed = refined(labs[keyframe], texture[keyframe], seed, hands[keyframe], contrast)
                objects = propagate(small, hands, seed, keyframe, contrast, texture)
        hands = np.stack([_holding(o, h) for o, h in zip(objects, hands, strict=True)])
        return Masks(enlarge(objects, height, width), enlarge(hands, height, width), keyframe, ())


def check_prompt(prompt: Prompt, count: int, height: int, width: int) -> None:
    """Refuse a prompt that does not fit the frames.

    Raises:
        InputError: one line says what does not fit.
    """
    if prompt.keyframe is not None and not 0 <= prompt.keyframe < count:
        raise InputError(f"keyframe {prompt.keyframe} is outside of the clip's frames 0 to {count - 1}")
    if prompt.mask is not None:
        if prompt.mask.shape != (height, width):
            had = f"{prompt.mask.shape[1]}×{prompt.mask.shape[0]}"
            raise InputError(f"the mask is {had} pixels, the frames are {width}×{height}")
        if not prompt.mask.any():
            raise InputError("the mask is empty: it marks no pixel of the object")
    if prompt.box is not None:
        x, y, w, h = prompt.box
        if w <= 0 or h <= 0 or x < 0 or y < 0 or x + w > width or y + h > height:
            raise InputError(f"the box {x},{y},{w},{h} does not lie within the {width}×{height} frames")


def shrink(images: UInt8[Array, "T H W 3"], side: int) -> UInt8[Array, "T h w 3"]:
    """Frames whose longest side is at most `side` [px]."""
    scale = min(1.0, side / max(images.shape[1:3]))
    size = round(images.shape[2] * scale), round(images.shape[1] * scale)
    return np.stack([cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in images])


def enlarge(masks: Bool[Array, "T h w"], height: int, width: int) -> Bool[Array, "T H W"]:
    """Masks at the full size, their edges smooth."""
    full = np.empty((len(masks), height, width), bool)
    for mask, out in zip(masks, full, strict=True):
        out[:] = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR) > 0.5
    return full


def _seed(
    labs: Float32[Array, "T H W 3"], hands: Bool[Array, "T H W"], prompt: Prompt, resting: bool
) -> tuple[int, Bool[Array, "H W"]]:
    """The keyframe and the object's mask on it."""
    height, width = hands.shape[1:]
    if prompt.mask is not None or prompt.box is not None:
        keyframe = prompt.keyframe or 0
        if prompt.mask is not None:
            given = cv2.resize(prompt.mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
            return keyframe, given > 0.5
        raise InputError("box")
    tried = [prompt.keyframe] if prompt.keyframe is not None else range(0, len(labs), max(1, len(labs) // 10))
    for keyframe in tried:
        found = find_object(labs[keyframe], hands[keyframe], not resting)
        if found.any():
            return keyframe, found
    raise InputError(
        "no object found: nothing stands out from its surroundings; mark it with --box x,y,w,h or --mask"
    )


def _holding(object_mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]) -> Bool[Array, "H W"]:
    """Only the skin that is at the object."""
    hand = hand & ~object_mask
    return touching(hand, grown(object_mask, 12))


def _changed(
    hands: Bool[Array, "T H W"],
    labs: Float32[Array, "T H W 3"],
    texture: UInt8[Array, "T H W"],
    contrast: Contrast,
) -> Bool[Array, "T H W"]:
    """The hands without what is only the scene, or their shadow on it."""
    covered = [contrast.changed(contrast.codes(lab, t)) > -1.2 for lab, t in zip(labs, texture, strict=True)]
    return np.stack([without_specks(h & c, 0.001 * h.size) for h, c in zip(hands, covered, strict=True)])
