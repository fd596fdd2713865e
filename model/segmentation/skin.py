"""Where skin is: a broad prior on chroma, sharpened to the people of this clip."""

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from model.segmentation.color_model import ColorModel, color_codes, log_ratio, to_lab
from model.types import Array


def skin_prior(image: UInt8[Array, "H W 3"]) -> Float32[Array, "H W"]:
    """How skin-like each pixel is, 0..1, before anything is known about the clip.

    Skin of all tones shares its chroma far more than its lightness.

    Reference:
        Chai, Ngan (1999), Face segmentation using skin-color map in videophone applications.
    """
    ycc = cv2.cvtColor(image, cv2.COLOR_RGB2YCrCb).astype(np.float32)
    luma, cr, cb = ycc[..., 0], ycc[..., 1], ycc[..., 2]
    # Chroma shrinks in the dark and under a weak lamp: judge the direction, and ask for enough of it.
    red, blue = cr - 128, 128 - cb
    ratio = (blue + 2) / np.maximum(red, 1)
    likely = np.exp(-0.5 * np.square((red - 24) / 11)) * np.exp(-0.5 * np.square((ratio - 0.8) / 0.35))
    likely *= (red > 7) & (luma > 35)
    return np.asarray(np.where(red > 40, 0.6 * likely, likely), np.float32)


class SkinModel:
    """Log-odds of skin per colour code, learned from a few frames of one clip."""

    def __init__(self, images: UInt8[Array, "T H W 3"]) -> None:
        """Learn from `images`, frames spread over the clip."""
        prior = np.stack([skin_prior(image) for image in images])
        opened = [
            cv2.morphologyEx((p > 0.45).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3))) for p in prior
        ]
        likely = np.stack(opened).astype(bool)
        self.found = bool(likely.sum() >= 0.001 * likely.size)
        """Whether the frames show any skin."""
        codes = color_codes(to_lab(images))
        self.table = log_ratio(ColorModel.of(codes, likely), ColorModel.of(codes, prior < 0.3))

    def __call__(self, image: UInt8[Array, "H W 3"]) -> Float32[Array, "H W"]:
        """Log-odds that each pixel is skin (without smoothing)."""
        prior = np.log(skin_prior(image) + 0.02) + 1.2
        if not self.found:
            return np.full(image.shape[:2], -5, np.float32)
        learned = np.clip(self.table[color_codes(to_lab(image))], -5, 5)
        return np.asarray((learned + prior), np.float32)
