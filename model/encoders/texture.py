"""Dense colour and texture features that need no weights."""

from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from model.encoders.base import SemanticEncoder
from model.types import Array

CELL = 4
"""Side of a grid cell [px]."""
COLOR_SIGMAS = (1.5, 5.0, 12.0)
"""Scales at which colour is looked at [px]."""
COLOR_UNITS = (15.0, 8.0, 8.0)
"""Differences in L*, a*, b* that count as one: several just noticeable ones, more in lightness, which
shading changes too."""
TENSOR_SIGMAS = (3.0, 8.0)
GABOR_WAVELENGTHS = (5.0, 11.0)
GABOR_ANGLES = (0.0, 45.0, 90.0, 135.0)
CONTRAST_SIGMAS = (3.0, 8.0)
CONTRAST_FLOOR = 1.0
"""Contrast [L*] below which texture is taken for sensor noise."""
PATTERN_RADIUS = 2
PATTERN_SIGMA = 6.0


class TextureEncoder(SemanticEncoder):
    """Colour at several scales, oriented energies, contrast and local patterns on a 4-px grid.

    The channels are in fixed units (colour in multiples of `COLOR_UNITS`, contrasts as logarithms), so that
    features of different images compare. In this order: CIELAB blurred at three scales (9); log energy and
    coherence of the structure tensor at two scales (4); log Gabor energies of two wavelengths, each as mean
    over four orientations, and their second circular harmonic (6); log local contrast at two scales (2);
    shares of spot-, edge- and noise-like local patterns (3).

    Reference:
        Bigün & Granlund (1987), Optimal orientation detection of linear symmetry (structure tensor);
        Manjunath & Ma (1996), Texture features for browsing and retrieval of image data (Gabor energies);
        Ojala, Pietikäinen & Mäenpää (2002), Multiresolution gray-scale and rotation invariant texture
        classification with local binary patterns (pattern classes).
    """

    name: ClassVar[str] = "texture"
    version: ClassVar[str] = "1"

    def __init__(self) -> None:
        """Needs nothing: there are no weights."""
        super().__init__()
        self.dim = (
            3 * len(COLOR_SIGMAS)
            + 2 * len(TENSOR_SIGMAS)
            + 3 * len(GABOR_WAVELENGTHS)
            + len(CONTRAST_SIGMAS)
            + 3
        )

    def forward(self, image: UInt8[Array, "H W 3"]) -> Float32[Array, "h w D"]:
        """Features of cells of about 4 px.

        Args:
            image: RGB.

        Returns:
            round(H/4) × round(W/4) cells that evenly cover the whole image.
        """
        lab = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
        lightness = lab[..., 0]
        channels = [
            *_colors(lab),
            *_structure(lightness),
            *_gabor(lightness),
            *_contrast(lightness),
            *_patterns(lightness),
        ]
        size = (max(1, round(image.shape[1] / CELL)), max(1, round(image.shape[0] / CELL)))
        cells = [cv2.resize(channel, size, interpolation=cv2.INTER_AREA) for channel in channels]
        features: Float32[Array, "h w D"] = np.stack(cells, axis=-1).astype(np.float32)
        return features


def _blur(channel: Float32[Array, "*shape"], sigma: float) -> Float32[Array, "*shape"]:
    blurred: Float32[Array, "*shape"] = cv2.GaussianBlur(
        channel, (0, 0), sigma, borderType=cv2.BORDER_REFLECT_101
    )
    return blurred


def _log_contrast(variance: Float32[Array, "H W"]) -> Float32[Array, "H W"]:
    """Logarithm of a standard deviation [L*], flat below the noise."""
    deviation = np.sqrt(np.maximum(variance, 0.0))
    logarithm: Float32[Array, "H W"] = np.log(deviation + CONTRAST_FLOOR).astype(np.float32)
    return logarithm


def _colors(lab: Float32[Array, "H W 3"]) -> list[Float32[Array, "H W"]]:
    """CIELAB at each scale, grey in the middle."""
    centred = (lab - np.array([50.0, 0.0, 0.0], np.float32)) / np.array(COLOR_UNITS, np.float32)
    return [channel for sigma in COLOR_SIGMAS for channel in cv2.split(_blur(centred, sigma))]


def _structure(lightness: Float32[Array, "H W"]) -> list[Float32[Array, "H W"]]:
    """Log energy and coherence (0: no direction, 1: one direction) of the structure tensor."""
    dx = cv2.Sobel(lightness, cv2.CV_32F, 1, 0, scale=0.125)
    dy = cv2.Sobel(lightness, cv2.CV_32F, 0, 1, scale=0.125)
    channels = []
    for sigma in TENSOR_SIGMAS:
        xx, yy, xy = _blur(dx * dx, sigma), _blur(dy * dy, sigma), _blur(dx * dy, sigma)
        energy = xx + yy
        direction = np.sqrt((xx - yy) ** 2 + 4.0 * xy**2)
        channels += [_log_contrast(energy), direction / (energy + np.float32(CONTRAST_FLOOR**2))]
    return channels


def _gabor(lightness: Float32[Array, "H W"]) -> list[Float32[Array, "H W"]]:
    """Mean over orientations of the log energy, and how it changes with orientation (2nd harmonic)."""
    channels = []
    for wavelength in GABOR_WAVELENGTHS:
        responses = []
        for angle in GABOR_ANGLES:
            even, odd = (_gabor_response(lightness, wavelength, angle, phase) for phase in (0.0, np.pi / 2))
            responses.append(_log_contrast(_blur(even**2 + odd**2, wavelength / 2)))
        across, falling, down, rising = responses
        channels += [sum(responses) / np.float32(4.0), (across - down) / 2, (falling - rising) / 2]
    return channels


def _gabor_response(
    lightness: Float32[Array, "H W"], wavelength: float, angle: float, phase: float
) -> Float32[Array, "H W"]:
    sigma = 0.45 * wavelength
    side = 2 * int(np.ceil(2.5 * sigma)) + 1
    kernel = cv2.getGaborKernel((side, side), sigma, np.deg2rad(angle), wavelength, 1.0, phase, cv2.CV_32F)
    kernel = kernel - kernel.mean()  # flat areas answer zero
    kernel = kernel / np.abs(kernel).sum()
    response: Float32[Array, "H W"] = cv2.filter2D(
        lightness, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT_101
    )
    return response


def _contrast(lightness: Float32[Array, "H W"]) -> list[Float32[Array, "H W"]]:
    """Log standard deviation of lightness around each pixel."""
    return [_log_contrast(_blur(lightness**2, s) - _blur(lightness, s) ** 2) for s in CONTRAST_SIGMAS]


def _patterns(lightness: Float32[Array, "H W"]) -> list[Float32[Array, "H W"]]:
    """Shares of local binary patterns that are spots, edges, and neither (more than two changes)."""
    r, diagonal = PATTERN_RADIUS, 1
    ring = [
        (-r, 0), (-diagonal, diagonal), (0, r), (diagonal, diagonal),
        (r, 0), (diagonal, -diagonal), (0, -r), (-diagonal, -diagonal),
    ]  # fmt: skip
    smooth = _blur(lightness, 0.8)
    padded = np.pad(smooth, r, mode="reflect" if min(lightness.shape) > r else "edge")
    height, width = lightness.shape
    higher = [
        padded[r + dy : r + dy + height, r + dx : r + dx + width] > smooth + CONTRAST_FLOOR for dy, dx in ring
    ]
    count = np.sum(higher, axis=0)
    changes = np.sum([a != b for a, b in zip(higher, higher[1:] + higher[:1], strict=True)], axis=0)
    uniform = changes <= 2
    classes = (uniform & (count >= 6), uniform & (count >= 2) & (count <= 5), ~uniform)
    return [_blur(each.astype(np.float32), PATTERN_SIGMA) for each in classes]
