"""What a camera at rest would see without object and hands, and how a frame differs from that."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from model.segmentation.color_model import ColorModel, log_ratio, to_lab
from model.segmentation.regions import around, grown, signed_distance, without_gaps
from model.types import Array

RATIO_BINS, DELTA_BINS, TEXTURE_BINS = 24, 20, 6
RATIO_STEP, DELTA_STEP = RATIO_BINS / 1.8, DELTA_BINS / 6.4
SHAPE = (RATIO_BINS, DELTA_BINS, DELTA_BINS, TEXTURE_BINS)


UNCHANGED = -2.2
"""Mean log-odds of change below which a whole region is the empty scene."""


def camera_rests(images: UInt8[Array, "T H W 3"]) -> bool:
    """Whether most textured points of the picture stay where they are throughout the clip."""
    grays = [
        cv2.cvtColor(images[i], cv2.COLOR_RGB2GRAY) for i in np.linspace(0, len(images) - 1, 5).astype(int)
    ]
    points = cv2.goodFeaturesToTrack(grays[0], 300, 0.01, 5)
    if points is None:
        return True
    still = []
    for later in grays[1:]:
        moved, status, _ = cv2.calcOpticalFlowPyrLK(grays[0], later, points, np.empty_like(points))
        shift = np.linalg.norm((moved - points).reshape(-1, 2), axis=1)
        still.append(float(((shift < 0.6) & (status.ravel() == 1)).mean()))
    return float(np.median(still)) > 0.2


def fill(values: Float32[Array, "H W 3"], known: Bool[Array, "H W"]) -> Float32[Array, "H W 3"]:
    """Unknown pixels filled from the known ones left and right of them, or above and below.

    Of the two lines through a pixel, the one whose ends look alike and are near counts most: the edge of
    a table that someone stands behind is continued, instead of smearing the dark clothes over it.
    """
    if known.all() or not known.any():
        return values
    weight = known.astype(np.float32)
    smooth = (
        cv2.blur(values * weight[..., None], (5, 5)) / np.maximum(cv2.blur(weight, (5, 5)), 1e-3)[..., None]
    )
    across, across_cost = _between_ends(smooth, known)
    turned = np.ascontiguousarray(smooth.transpose(1, 0, 2))
    down, down_cost = _between_ends(turned, np.ascontiguousarray(known.T))
    share = 1 / (1 + np.exp(np.clip((across_cost - down_cost.T) / 4, -30, 30)))[..., None]
    filled = share * across + (1 - share) * down.transpose(1, 0, 2)
    filled = cv2.blur(np.where(known[..., None], values, filled).astype(np.float32), (5, 3))
    return np.asarray(np.where(known[..., None], values, filled), np.float32)


def _between_ends(
    values: Float32[Array, "H W 3"], known: Bool[Array, "H W"]
) -> tuple[Float32[Array, "H W 3"], Float32[Array, "H W"]]:
    """Along each row, the blend of the nearest known pixels on both sides, and how little to trust it."""
    height, width = known.shape
    x = np.broadcast_to(np.arange(width), known.shape)
    left = np.maximum.accumulate(np.where(known, x, -1), axis=1)
    right = np.minimum.accumulate(np.where(known, x, width)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height)[:, None]
    from_left, from_right = values[rows, np.maximum(left, 0)], values[rows, np.minimum(right, width - 1)]
    gap_left = np.where(left >= 0, x - left, 1e6).astype(np.float32)
    gap_right = np.where(right < width, right - x, 1e6).astype(np.float32)
    share = (gap_right / np.maximum(gap_left + gap_right, 1))[..., None]
    blend = share * from_left + (1 - share) * from_right
    both = (left >= 0) & (right < width)
    unlike = np.where(both, np.abs(from_left - from_right).sum(-1), 15)
    cost = unlike + 0.1 * np.minimum(gap_left, gap_right) + 60 * ((left < 0) & (right >= width))
    return blend.astype(np.float32), cost.astype(np.float32)


@dataclass(frozen=True)
class Background:
    """The empty scene."""

    lab: Float32[Array, "H W 3"]
    seen: Bool[Array, "H W"]
    """Where it was really seen; elsewhere it was filled in from around."""

    @staticmethod
    def of(images: UInt8[Array, "T H W 3"], blocked: Bool[Array, "T H W"]) -> "Background":
        """The median over the frames in which each pixel is not `blocked`."""
        chosen = np.unique(np.linspace(0, len(images) - 1, 32).round().astype(int))
        free = ~blocked[chosen]
        stack = np.where(free[..., None], images[chosen].astype(np.uint16), 999)
        stack.sort(axis=0)
        count = free.sum(0)
        middle = np.broadcast_to(np.maximum(count - 1, 0)[None, ..., None] // 2, (1, *stack.shape[1:]))
        median = np.take_along_axis(stack, middle, 0)[0]
        seen = count >= max(2, len(chosen) // 10)
        lab = to_lab(np.clip(median, 0, 255).astype(np.uint8))
        return Background(fill(lab, seen), seen)


def textures(images: UInt8[Array, "T H W 3"], width: int, height: int) -> UInt8[Array, "T h w"]:
    """Fine contrast (standard deviation in 5×5 pixels, ×16) of full-size frames, on a smaller grid."""
    out = np.empty((len(images), height, width), np.uint8)
    for image, texture in zip(images, out, strict=True):
        gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
        gray -= cv2.blur(gray, (9, 9))
        spread = cv2.blur(gray * gray, (5, 5)) - np.square(cv2.blur(gray, (5, 5)))
        small = cv2.resize(np.sqrt(np.maximum(spread, 0)), (width, height), interpolation=cv2.INTER_AREA)
        # The contrast of an outline reaches out of the object: take it back.
        texture[:] = np.clip(cv2.erode(small, np.ones((3, 3), np.uint8)) * 16, 0, 255)
    return out


def difference_codes(
    lab: Float32[Array, "H W 3"],
    texture: UInt8[Array, "H W"],
    background: Float32[Array, "H W 3"],
    plain: float,
) -> Int32[Array, "H W"]:
    """How each pixel differs from the empty scene, as one number.

    Lightness counts as a ratio (a shadow dims, and does not much else), chroma as a difference after that
    dimming, and texture against the `plain` texture of the scene, since a shadow adds none.
    """
    # An edge of the scene may lie a pixel aside: compare with the closest value right there.
    kernel = np.ones((3, 3), np.uint8)
    background = np.clip(lab, cv2.erode(background, kernel), cv2.dilate(background, kernel))
    ratio = (lab[..., 0] + 4) / (background[..., 0] + 4)
    delta = lab[..., 1:] - background[..., 1:] * np.minimum(ratio, 1)[..., None]
    level = np.clip((np.log(ratio) + 1.2) * RATIO_STEP, 0, RATIO_BINS - 1).astype(np.int32)
    chroma = np.arcsinh(delta / 3) * DELTA_STEP + DELTA_BINS / 2
    a, b = np.moveaxis(np.clip(chroma, 0, DELTA_BINS - 1).astype(np.int32), -1, 0)
    edges = np.array([1.2, 1.7, 2.4, 3.4, 5.0], np.float32) * (plain + 5)
    rough = np.searchsorted(edges, texture).astype(np.int32)
    codes: Int32[Array, "H W"] = ((level * DELTA_BINS + a) * DELTA_BINS + b) * TEXTURE_BINS + rough
    return codes


def shadow_prior() -> Float32[Array, " C"]:
    """Log-odds per difference code that it is an object, before anything was learned.

    Nothing changed, or dimmed without change of hue or texture: empty scene or a shadow on it. The more
    the hue or the texture differs, the brighter than the scene, or the darker than shadows get: an object.
    """
    level = ((np.arange(RATIO_BINS) + 0.5) / RATIO_STEP - 1.2)[:, None, None, None]
    delta = 3 * np.sinh((np.arange(DELTA_BINS) + 0.5 - DELTA_BINS / 2) / DELTA_STEP)
    hue = np.hypot(delta[:, None], delta[None, :])[None, :, :, None]
    dark = 1.2 * np.clip(-level, 0, 0.5) + 6 * np.clip(-level - 0.5, 0, 0.5)
    bright = 14 * np.clip(level - 0.04, 0, 0.3)
    rough = np.array([-0.9, -0.5, 0.1, 0.7, 1.2, 1.5])
    odds = -1.8 + 0.55 * np.clip(hue - 2.5, 0, 8) + dark + bright + rough
    return np.asarray(np.clip(odds, -3, 3).reshape(-1), np.float32)


@dataclass(frozen=True)
class Contrast:
    """Log-odds that a pixel is the object, from how it differs from the empty scene."""

    background: Background
    plain: float
    """Median texture of the empty scene around the object."""
    table: Float32[Array, " C"]
    """Per difference code."""

    @staticmethod
    def guess(
        images: UInt8[Array, "T H W 3"],
        texture: UInt8[Array, "T H W"],
        objects: Bool[Array, "T H W"],
        hands: Bool[Array, "T H W"],
    ) -> "Contrast":
        """From the empty scene behind rough masks, and what is known of shadows in general."""
        # A gap in a rough mask must not teach the object's own colours as the scene's: block gaps, too.
        blocked = np.stack([grown(without_gaps(o, 6) | h, 4) for o, h in zip(objects, hands, strict=True)])
        sample = range(0, len(images), max(1, len(images) // 8))
        near = [texture[i][grown(blocked[i], 15) & ~blocked[i]] for i in sample]
        plain = float(np.median(np.concatenate(near))) if any(map(len, near)) else 0.0
        return Contrast(Background.of(images, blocked), plain, 1.3 * shadow_prior())

    def learned(
        self,
        images: UInt8[Array, "T H W 3"],
        texture: UInt8[Array, "T H W"],
        objects: Bool[Array, "T H W"],
        hands: Bool[Array, "T H W"],
    ) -> "Contrast":
        """Sharpened to this clip by masks that are nearly right."""
        codes, inside, outside, prior = [], [], [], shadow_prior()
        for index in np.unique(np.linspace(0, len(images) - 1, 16).round().astype(int)):
            if not objects[index].any():
                continue
            window = around(objects[index], 30)
            mask, hand = objects[index][window], grown(hands[index][window], 2)
            codes.append(self.codes(to_lab(images[index]), texture[index])[window].ravel())
            # What looks like a shadow is believed to be object only well within the mask.
            depth = signed_distance(mask)
            sure = ((prior[codes[-1]].reshape(mask.shape) > 0.3) & (depth > 2)) | (depth > 8)
            inside.append((mask & sure & ~hand).ravel())
            outside.append((~grown(without_gaps(mask, 6), 1) & ~hand).ravel())
        if not codes:
            return self
        seen = np.concatenate(codes)
        models = [ColorModel.of(seen, np.concatenate(where), SHAPE) for where in (inside, outside)]
        table = 0.45 * np.clip(log_ratio(*models), -1.5, 4) + 1.1 * prior
        return Contrast(self.background, self.plain, table.astype(np.float32))

    def codes(self, lab: Float32[Array, "H W 3"], texture: UInt8[Array, "H W"]) -> Int32[Array, "H W"]:
        """The difference codes of a whole frame."""
        return difference_codes(lab, texture, self.background.lab, self.plain)

    def odds(self, codes: Int32[Array, "*n"]) -> Float32[Array, "*n"]:
        """Log-odds of the object."""
        odds: Float32[Array, "*n"] = self.table[codes]
        return odds

    def changed(self, codes: Int32[Array, "*n"]) -> Float32[Array, "*n"]:
        """Log-odds that something covers the scene, whatever was learned about the object."""
        odds: Float32[Array, "*n"] = shadow_prior()[codes]
        return odds

    def doubt(self, codes: Int32[Array, "*n"]) -> Float32[Array, "*n"]:
        """1 where the empty scene cannot tell, 0 where it is sure."""
        return np.asarray(np.exp(-np.square(np.minimum(self.changed(codes) + 0.3, 0) / 1.2)), np.float32)
