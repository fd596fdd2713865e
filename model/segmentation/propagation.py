"""Carrying the object's mask from the keyframe through time."""

from collections.abc import Iterable

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from model.segmentation.background import UNCHANGED, Contrast
from model.segmentation.color_model import ColorModel, color_codes, log_ratio, to_lab
from model.segmentation.min_cut import edge_weights, min_cut
from model.segmentation.regions import (
    around,
    grown,
    signed_distance,
    touching,
    with_doubtful_holes,
    without_gaps,
    without_holes,
)
from model.types import Array

MARGIN = 30
"""How far around the object we look for it in the next frame [px at the small size]."""


def backward_flow(now: UInt8[Array, "H W"], before: UInt8[Array, "H W"]) -> Float32[Array, "H W 2"]:
    """Where each pixel of `now` was in the frame `before`, as a displacement [px].

    Reference:
        Kroeger et al. (2016), Fast optical flow using dense inverse search.
    """
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = np.zeros((*now.shape, 2), np.float32)
    return np.asarray(dis.calc(now, before, flow))


def warped(image: Float32[Array, "H W"], flow: Float32[Array, "H W 2"]) -> Float32[Array, "H W"]:
    """The image of the frame before, drawn where its pixels are now."""
    height, width = image.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    moved: Float32[Array, "H W"] = cv2.remap(image, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR)
    return moved


def propagate(
    images: UInt8[Array, "T H W 3"],
    hands: Bool[Array, "T H W"],
    seed: Bool[Array, "H W"],
    keyframe: int,
    contrast: Contrast | None = None,
    texture: UInt8[Array, "T H W"] | None = None,
) -> Bool[Array, "T H W"]:
    """The object in every frame, from its mask on the keyframe."""
    carrier = _Carrier(images, hands, seed, keyframe, contrast, texture)
    count = len(images)
    for steps in (range(keyframe + 1, count), range(keyframe - 1, -1, -1)):
        carrier.carry(steps, keyframe)
    return carrier.masks


class _Carrier:
    """One pass over the clip."""

    def __init__(
        self,
        images: UInt8[Array, "T H W 3"],
        hands: Bool[Array, "T H W"],
        seed: Bool[Array, "H W"],
        keyframe: int,
        contrast: Contrast | None,
        texture: UInt8[Array, "T H W"] | None,
    ) -> None:
        self.images, self.hands, self.contrast, self.texture = images, hands, contrast, texture
        self.masks = np.zeros(hands.shape, bool)
        self.masks[keyframe] = seed
        self.skin = ColorModel.of(color_codes(to_lab(images[keyframe])), hands[keyframe])

    def carry(self, steps: Iterable[int], keyframe: int) -> None:
        """Walk away from the keyframe; colours are those of the keyframe, updated slowly."""
        before = keyframe
        inside, outside = self._models(keyframe, to_lab(self.images[keyframe]))
        gray = cv2.cvtColor(self.images[keyframe], cv2.COLOR_RGB2GRAY)
        for now in steps:
            last, gray = gray, cv2.cvtColor(self.images[now], cv2.COLOR_RGB2GRAY)
            prior = warped(self.masks[before].astype(np.float32), backward_flow(gray, last))
            if not (prior > 0.5).any():
                prior = self.masks[before].astype(np.float32)
                if not prior.any():
                    return
            lab = to_lab(self.images[now])
            self._cut(now, lab, prior, log_ratio(inside, self._others(outside)))
            newer = self._models(now, lab)
            inside, outside = inside.blend(newer[0], 0.03), outside.blend(newer[1], 0.1)
            before = now

    def _others(self, outside: ColorModel) -> ColorModel:
        return outside.blend(self.skin, 0.3) if self.skin.total > 0 else outside

    def _models(self, index: int, lab: Float32[Array, "H W 3"]) -> tuple[ColorModel, ColorModel]:
        """Colours of the object and of what is around it."""
        mask = self.masks[index]
        window = around(mask, MARGIN) if mask.any() else (slice(None), slice(None))
        mask, hand, codes = mask[window], self.hands[index][window], color_codes(lab[window])
        core = signed_distance(mask) > 1.5
        return ColorModel.of(codes, core if core.any() else mask), ColorModel.of(
            codes, ~grown(mask, 1) & ~hand
        )

    def _cut(
        self,
        now: int,
        lab: Float32[Array, "H W 3"],
        prior: Float32[Array, "H W"],
        ratio: Float32[Array, " C"],
    ) -> None:
        """Balance colour, difference from the empty scene, the warped mask and the picture's edges."""
        window = around(prior > 0.5, MARGIN)
        hand, near = self.hands[now][window], lab[window]
        color = np.clip(ratio[color_codes(near)], -3, 3)
        distance = signed_distance(prior[window] > 0.5)
        place = np.clip(distance / 2, -3, 3) - np.maximum(-distance - 5, 0) * 0.5
        doubt, changed = np.zeros_like(distance), np.full_like(distance, -9)
        if self.contrast is None or self.texture is None:
            evidence = color + place
        else:
            # Where the scene behind does not tell (white fur on a white table), motion decides.
            codes = self.contrast.codes(lab, self.texture[now])[window]
            doubt, changed = self.contrast.doubt(codes), self.contrast.changed(codes)
            odds = np.clip(self.contrast.odds(codes), -4, 4)
            evidence = 0.3 * color + odds + (0.3 + 0.5 * doubt) * place - 0.8
        evidence = (evidence - 2.5 * (hand & (prior[window] < 0.9))).astype(np.float32)
        u = min_cut(evidence, *edge_weights(near, 3.0), prior[window], 40)
        mask = (u > 0.5) & ~(hand & (prior[window] < 0.5))
        mask |= without_gaps(mask, 5) & (distance > 0) & (doubt > 0.1) & ~hand
        mask = with_doubtful_holes(mask, np.where(hand, np.float32(-9), changed), UNCHANGED)
        self.masks[now][window] = without_holes(touching(mask, distance > 1.5), 30.0)
