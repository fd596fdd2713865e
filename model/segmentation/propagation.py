"""Carrying the object's mask from the keyframe through time."""

from collections.abc import Iterable

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from model.segmentation.color_model import ColorModel, color_codes, log_ratio
from model.segmentation.min_cut import edge_weights, min_cut
from model.segmentation.regions import around, grown, signed_distance, touching, without_holes
from model.types import Array

MARGIN = 30
"""How far around the object we look for it in the next frame [px at the small size]."""


def backward_flow(now: UInt8[Array, "H W"], before: UInt8[Array, "H W"]) -> Float32[Array, "H W 2"]:
    """Where each pixel of `now` was in the frame `before`, as a displacement [px].

    Reference:
        Kroeger et al. (2016), Fast optical flow using dense inverse search.
    """
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow: Float32[Array, "H W 2"] = dis.calc(now, before, None)
    return flow


def warped(image: Float32[Array, "H W"], flow: Float32[Array, "H W 2"]) -> Float32[Array, "H W"]:
    """The image of the frame before, drawn where its pixels are now."""
    height, width = image.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    moved: Float32[Array, "H W"] = cv2.remap(image, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR)
    return moved


def propagate(
    labs: Float32[Array, "T H W 3"],
    hands: Bool[Array, "T H W"],
    seed: Bool[Array, "H W"],
    keyframe: int,
) -> Bool[Array, "T H W"]:
    """The object in every frame, from its mask on the keyframe."""
    masks = np.zeros(hands.shape, bool)
    masks[keyframe] = seed
    count = len(masks)
    grays = np.clip(labs[..., 0] * 2.55, 0, 255).astype(np.uint8)
    skin = ColorModel.of(color_codes(labs[keyframe]), hands[keyframe])
    for steps in (range(keyframe + 1, count), range(keyframe - 1, -1, -1)):
        _carry(masks, labs, grays, hands, skin, steps, keyframe)
    return masks


def _carry(
    masks: Bool[Array, "T H W"],
    labs: Float32[Array, "T H W 3"],
    grays: UInt8[Array, "T H W"],
    hands: Bool[Array, "T H W"],
    skin: ColorModel,
    steps: Iterable[int],
    keyframe: int,
) -> None:
    before = keyframe
    codes = color_codes(labs[keyframe])
    inside, outside = _models(codes, masks[keyframe], hands[keyframe])
    for now in steps:
        flow = backward_flow(grays[now], grays[before])
        prior = warped(masks[before].astype(np.float32), flow)
        if not (prior > 0.5).any():
            prior = masks[before].astype(np.float32)
            if not prior.any():
                return
        window = around(prior > 0.5, MARGIN)
        codes = color_codes(labs[now][window])
        masks[now][window] = _cut(
            labs[now][window], codes, prior[window], hands[now][window], inside, outside, skin
        )
        newer = _models(codes, masks[now][window], hands[now][window])
        inside, outside = inside.blend(newer[0], 0.04), outside.blend(newer[1], 0.1)
        before = now


def _models(
    codes: Int32[Array, "H W"], mask: Bool[Array, "H W"], hand: Bool[Array, "H W"]
) -> tuple[ColorModel, ColorModel]:
    """Colours of the object and of what is around it."""
    window = around(mask, MARGIN) if mask.any() else (slice(None), slice(None))
    mask, hand, codes = mask[window], hand[window], codes[window]
    rim = grown(mask, 1) & ~mask
    return ColorModel.of(codes, mask), ColorModel.of(codes, ~mask & ~rim & ~hand)


def _cut(
    lab: Float32[Array, "H W 3"],
    codes: Int32[Array, "H W"],
    prior: Float32[Array, "H W"],
    hand: Bool[Array, "H W"],
    inside: ColorModel,
    outside: ColorModel,
    skin: ColorModel,
) -> Bool[Array, "H W"]:
    """Balance colour, the warped mask and the picture's edges."""
    others = outside.blend(skin, 0.3) if skin.total > 0 else outside
    color = np.clip(log_ratio(inside, others)[codes], -3, 3)
    distance = signed_distance(prior > 0.5)
    place = np.clip(distance / 2, -3, 3) - np.maximum(-distance - 10, 0) * 0.5
    evidence = (color + place - 2.5 * (hand & (prior < 0.9))).astype(np.float32)
    u = min_cut(evidence, *edge_weights(lab, 3.0), prior, 40)
    mask = (u > 0.5) & ~(hand & (prior < 0.5))
    return without_holes(touching(mask, distance > 1.5), 30)
