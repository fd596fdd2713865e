"""Colours as codes, and how likely each code is under a region: smoothed histograms in Lab."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8
from scipy.ndimage import gaussian_filter

from model.types import Array

L_BINS, AB_BINS = 24, 48
SHAPE = (L_BINS, AB_BINS, AB_BINS)
"""Of the histogram that `color_codes` indexes."""


def to_lab(image: UInt8[Array, "*n H W 3"]) -> Float32[Array, "*n H W 3"]:
    """CIE Lab, L in 0..100, of RGB images."""
    flat = np.ascontiguousarray(image).reshape(-1, image.shape[-2], 3).astype(np.float32) / 255
    lab: Float32[Array, "*n H W 3"] = cv2.cvtColor(flat, cv2.COLOR_RGB2LAB).reshape(image.shape)
    return lab


def color_codes(lab: Float32[Array, "*n 3"]) -> Int32[Array, "*n"]:
    """One number per colour: fine steps near grey, where real scenes crowd, coarser ones away from it."""
    level = np.clip(lab[..., 0] * (L_BINS / 100.001), 0, L_BINS - 1).astype(np.int32)
    chroma = np.arcsinh(lab[..., 1:] / 8) * (AB_BINS / 6.2) + AB_BINS / 2
    a, b = np.moveaxis(np.clip(chroma, 0, AB_BINS - 1).astype(np.int32), -1, 0)
    codes: Int32[Array, "*n"] = (level * AB_BINS + a) * AB_BINS + b
    return codes


@dataclass(frozen=True)
class ColorModel:
    """How likely each colour code is."""

    counts: Float32[Array, " C"]
    """Smoothed counts per code; their sum is the number of pixels seen."""

    @staticmethod
    def of(
        codes: Int32[Array, "*n"], where: Bool[Array, "*n"], shape: tuple[int, ...] = SHAPE
    ) -> "ColorModel":
        """The model of the pixels `where`; `shape` is that of the histogram the codes index."""
        counts = np.bincount(codes[where], minlength=int(np.prod(shape))).astype(np.float32)
        return ColorModel(gaussian_filter(counts.reshape(shape), 1.0, mode="nearest").reshape(-1))

    def blend(self, newer: "ColorModel", weight: float) -> "ColorModel":
        """Move towards a newer model; both count as equally large."""
        scale = self.total / max(newer.total, 1.0)
        return ColorModel((1 - weight) * self.counts + np.float32(weight * scale) * newer.counts)

    @property
    def total(self) -> float:
        """Pixels seen."""
        return float(self.counts.sum())

    def density(self) -> Float32[Array, " C"]:
        """Probability per code, with a floor for colours never seen."""
        probability: Float32[Array, " C"] = self.counts / max(self.total, 1.0) + np.float32(2e-6)
        return probability


def log_ratio(inside: ColorModel, outside: ColorModel) -> Float32[Array, " C"]:
    """Per colour code, log P(code | inside) − log P(code | outside)."""
    ratio: Float32[Array, " C"] = np.log(inside.density()) - np.log(outside.density())
    return ratio


def as_bytes(lab: Float32[Array, "H W 3"]) -> UInt8[Array, "H W 3"]:
    """Lab stretched into bytes, chroma doubled: what GrabCut is fed."""
    scaled = lab * np.array([2.55, 2.0, 2.0], np.float32) + np.array([0, 128, 128], np.float32)
    stretched: UInt8[Array, "H W 3"] = np.clip(scaled, 0, 255).astype(np.uint8)
    return stretched
