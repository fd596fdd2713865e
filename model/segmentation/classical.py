"""The default segmenter: colour, saliency, flow and cuts; nothing to download."""

from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from model.errors import InputError
from model.segmentation.background import Contrast, camera_rests, textures
from model.segmentation.base import Segmenter
from model.segmentation.checks import check_prompt, doubts
from model.segmentation.color_model import to_lab
from model.segmentation.keyframe import find_object, hand_regions, object_in_box, refined, settle
from model.segmentation.propagation import propagate
from model.segmentation.regions import grown, touching, without_specks
from model.segmentation.skin import SkinModel
from model.segmentation.snapping import snap_all
from model.types import Array, Frames, Masks, Prompt

SMALL_SIDE = 424
"""Longest side of the pictures in which we search [px]."""
FLOW_SIDE = 12
"""Narrower small pictures than this [px] have no optical flow."""
NEAR = 12
"""Skin no farther than this from the object holds it [px of the small pictures]."""


class ClassicalSegmenter(Segmenter):
    """Skin by its colour; the object by what stands out near it, carried through time by optical flow.

    Where the camera rests, the scene behind object and hand is estimated from the whole clip, and the
    object is sharpened by how it differs from that scene (shadows discounted).
    """

    name: ClassVar[str] = "classical"
    version: ClassVar[str] = "1"

    def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
        """Segment the clip.

        Args:
            frames: The clip.
            prompt: A mask is taken as it is on the keyframe; a box limits the search to its inside.

        Raises:
            InputError: nothing stands out as an object, or the prompt does not fit the frames.
        """
        height, width = frames.images.shape[1:3]
        check_prompt(prompt, len(frames.images), height, width)
        small = shrink(frames.images, SMALL_SIDE)
        if min(small.shape[1:3]) < FLOW_SIDE:
            raise InputError(f"{frames.name}: {width}×{height} pixels are too narrow to find an object in")
        labs = np.stack([to_lab(image) for image in small])
        sample = np.linspace(0, len(small) - 1, 8).round().astype(int)
        skin = SkinModel(small[sample])
        hands = np.stack([hand_regions(skin(image)) for image in small])
        resting = camera_rests(small)
        keyframe, seed = _seed(labs, hands, prompt, height, resting)
        if prompt.mask is None:
            seed, hands[keyframe] = settle(seed, hands[keyframe])
        hands[keyframe] &= ~seed
        objects = propagate(small, hands, seed, keyframe)
        if resting:
            texture = textures(frames.images, small.shape[2], small.shape[1])
            given = prompt.mask is not None
            objects, hands = _sharpened(small, labs, texture, objects, hands, keyframe, given)
        elif prompt.mask is None:
            _look_back(small, objects, hands, keyframe)
        hands = np.stack([_holding(o, h) for o, h in zip(objects, hands, strict=True)])
        warnings = doubts(labs[keyframe], objects, hands, keyframe)
        full, hand = snap_all(objects, hands, frames.images)
        if prompt.mask is not None:
            full[keyframe] = prompt.mask
        return Masks(full, hand & ~full, keyframe, warnings)


def shrink(images: UInt8[Array, "T H W 3"], side: int) -> UInt8[Array, "T h w 3"]:
    """Frames whose longest side is at most `side` [px]."""
    scale = min(1.0, side / max(images.shape[1:3]))
    size = round(images.shape[2] * scale), round(images.shape[1] * scale)
    return np.stack([cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in images])


def _seed(
    labs: Float32[Array, "T H W 3"],
    hands: Bool[Array, "T H W"],
    prompt: Prompt,
    full_height: int,
    resting: bool,
) -> tuple[int, Bool[Array, "H W"]]:
    """The keyframe and the object's mask on it: what the user says, else the first frame that shows both."""
    height, width = hands.shape[1:]
    asked = prompt.keyframe or 0
    if prompt.mask is not None:
        given = cv2.resize(prompt.mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        return asked, given >= min(0.5, float(given.max()))
    if prompt.box is not None:
        x, y, w, h = (round(value * height / full_height) for value in prompt.box)
        found = object_in_box(labs[asked], hands[asked], (slice(y, y + max(h, 1)), slice(x, x + max(w, 1))))
        if not found.any():
            raise InputError("no object found in the box; draw it a little wider, or give a --mask")
        return asked, found
    # something has to follow the keyframe
    tried = range(0, max(1, len(labs) - 1), max(1, len(labs) // 10)) if prompt.keyframe is None else [asked]
    first: tuple[int, Bool[Array, "H W"]] | None = None
    for keyframe in tried:
        found = find_object(labs[keyframe], hands[keyframe], not resting)
        if not found.any():
            continue
        first = first or (keyframe, found)
        if (grown(found, NEAR) & hands[keyframe]).any() or not hands.any():
            return keyframe, found
    if first is None:
        raise InputError(
            "no object found: nothing stands out near a hand; mark the object with --box x,y,w,h or --mask"
        )
    return first


def _sharpened(
    small: UInt8[Array, "T H W 3"],
    labs: Float32[Array, "T H W 3"],
    texture: UInt8[Array, "T H W"],
    objects: Bool[Array, "T H W"],
    hands: Bool[Array, "T H W"],
    keyframe: int,
    given: bool,
) -> tuple[Bool[Array, "T H W"], Bool[Array, "T H W"]]:
    """Objects and hands, told from the empty scene behind them; a `given` keyframe mask stays as it is."""
    rough, seed = objects, objects[keyframe]
    for again in (False, True, True):
        contrast = Contrast.guess(small, texture, objects | rough, hands)
        if again:
            contrast = contrast.learned(small, texture, objects, hands)
        else:
            hands = _changed(hands, labs, texture, contrast)
        if not given:
            seed = refined(labs[keyframe], texture[keyframe], seed, hands[keyframe], contrast)
        objects = propagate(small, hands, seed, keyframe, contrast, texture)
    if not given:
        _look_back(small, objects, hands, keyframe, contrast, texture)
    return objects, hands


def _changed(
    hands: Bool[Array, "T H W"],
    labs: Float32[Array, "T H W 3"],
    texture: UInt8[Array, "T H W"],
    contrast: Contrast,
) -> Bool[Array, "T H W"]:
    """The hands without what is only the scene, or their shadow on it."""
    covered = [contrast.changed(contrast.codes(lab, t)) > -1.2 for lab, t in zip(labs, texture, strict=True)]
    return np.stack([without_specks(h & c, 0.001 * h.size) for h, c in zip(hands, covered, strict=True)])


def _look_back(
    small: UInt8[Array, "T H W 3"],
    objects: Bool[Array, "T H W"],
    hands: Bool[Array, "T H W"],
    keyframe: int,
    contrast: Contrast | None = None,
    texture: UInt8[Array, "T H W"] | None = None,
) -> None:
    """Complete a patchy keyframe from some frames later, where its gaps have closed."""
    later = min(keyframe + 15, len(small) - 1)
    if not objects[later].any():
        return
    part = slice(keyframe, later + 1)
    nearby = None if texture is None else texture[part]
    back = propagate(small[part], hands[part], objects[later], later - keyframe, contrast, nearby)
    if (back[0] & objects[keyframe]).sum() > 0.8 * objects[keyframe].sum():
        objects[part] = back


def _holding(object_mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]) -> Bool[Array, "H W"]:
    """Only the skin that is at the object."""
    hand = hand & ~object_mask
    return touching(hand, grown(object_mask, NEAR))
