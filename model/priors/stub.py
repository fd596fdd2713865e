"""A material expert that needs nothing: colour, texture and outline, and a wide answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from model.priors.materials import combine, normalised
from model.shape import guess_shape
from model.types import Array, MaterialPrior, PartView, ShapeClass

WARNING = (
    "material prior is a stub: it only looks at colour, texture and outline, and cannot tell materials well"
)

BASE: Mapping[str, float] = {
    "fabric": 0.42, "fur": 0.18, "silk": 0.10, "denim": 0.08, "leather": 0.07,
    "rubber": 0.07, "plastic": 0.03, "paper": 0.03, "wood": 0.01, "metal": 0.01,
}  # fmt: skip
"""Before looking: what soft objects that people handle on video tend to be made of."""

SHAPE_EVIDENCE: Mapping[ShapeClass, Mapping[str, float]] = {
    "sheet": {
        "silk": 0.4,
        "denim": 0.4,
        "paper": 0.3,
        "fur": -0.5,
        "wood": -0.5,
        "metal": -0.5,
        "rubber": -0.3,
    },
    "rope": {"fabric": 0.4, "rubber": 0.2, "paper": -0.5, "wood": -0.5, "silk": -0.3, "fur": -0.3},
    "solid": {"fur": 0.3, "silk": -0.3, "paper": -0.3},
}
"""Added to the logarithm of the weight: what each outline speaks for and against."""

ROUGH, SMOOTH = 3.0, 1.0
"""Fine contrast [L*] of pile and coarse weave, and of skins and films."""
STRENGTH = 0.6
"""Most that one cue moves the logarithm of a weight: a factor of 1.8, a hint and no proof."""


@dataclass(frozen=True)
class Appearance:
    """What is measured on the pixels of a part."""

    lightness: float
    """Median L*."""
    chroma: float
    """Median colourfulness, CIELAB."""
    hue: float
    """Of the median colour [degrees], CIELAB: 0 red, 90 yellow, 270 blue."""
    contrast: float
    """Median deviation of lightness within a few pixels [L*]."""
    gloss: float
    """Share of pixels far lighter and greyer than the rest, 0..1."""


class StubPrior:
    """Believes a little of everything, nudged by colour, texture and outline."""

    name: ClassVar[str] = "stub"
    version: ClassVar[str] = "1"
    weights: str | None = None

    def material(self, part: PartView) -> MaterialPrior:
        """Deterministic: the same pixels get the same answer; a shape class that is known is believed.

        A part without a visible pixel is judged by the whole object, and says so.
        """
        warnings = [WARNING]
        mask = part.mask
        if not mask.any():
            warnings.append(f"{part.label} is not visible on the keyframe: judged by the whole object")
            mask = part.object_mask
        outline = part.object_mask if part.object_mask.any() else mask
        shape = part.shape_class or guess_shape(part.image, outline)
        evidence = dict(SHAPE_EVIDENCE[shape])
        if mask.any():
            for material, value in _evidence(measure(part.image, mask)).items():
                evidence[material] = evidence.get(material, 0.0) + value
        distribution = normalised(
            {name: weight * float(np.exp(evidence.get(name, 0.0))) for name, weight in BASE.items()}
        )
        return MaterialPrior(distribution, combine(distribution, shape), shape, tuple(warnings))


def measure(image: UInt8[Array, "H W 3"], mask: Bool[Array, "H W"]) -> Appearance:
    """Appearance of the pixels of a mask that is not empty."""
    lab = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
    lightness = lab[..., 0]
    mean = cv2.GaussianBlur(lightness, (0, 0), 2.0)
    deviation = np.sqrt(np.maximum(cv2.GaussianBlur(lightness**2, (0, 0), 2.0) - mean**2, 0.0))
    core = cv2.erode(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0  # the outline is no texture
    pixels = lab[mask]
    middle = np.median(pixels, axis=0)
    chroma = np.hypot(pixels[:, 1], pixels[:, 2])
    colourful = float(np.median(chroma))
    shiny = (pixels[:, 0] > middle[0] + 25.0) & (chroma < max(0.6 * colourful, 4.0))
    return Appearance(
        lightness=float(middle[0]),
        chroma=colourful,
        hue=float(np.rad2deg(np.arctan2(middle[2], middle[1])) % 360.0),
        contrast=float(np.median(deviation[core if core.any() else mask])),
        gloss=float(shiny.mean()),
    )


def _evidence(seen: Appearance) -> dict[str, float]:
    """What an appearance adds to the logarithm of each material's weight."""
    rough = np.clip(np.log(seen.contrast / SMOOTH + 1e-6) / np.log(ROUGH / SMOOTH), -1.0, 1.0)
    glossy = min(seen.gloss / 0.05, 1.0)
    grey = float(np.clip(1.0 - seen.chroma / 12.0, 0.0, 1.0))
    dark = float(np.clip((50.0 - seen.lightness) / 25.0, 0.0, 1.0))
    deep = float(np.clip((60.0 - seen.lightness) / 20.0, 0.0, 1.0))
    blue = _near(seen.hue, 275.0, 35.0) * (1.0 - grey) * deep
    brown = _near(seen.hue, 65.0, 30.0) * (1.0 - grey)
    cues = {
        "fur": 1.0 * rough,
        "denim": 0.4 * rough + 1.5 * blue,
        "fabric": 0.3 * rough,
        "silk": -0.6 * rough + 0.8 * glossy,
        "rubber": -0.4 * rough + 0.4 * dark * grey,
        "plastic": -0.6 * rough + 1.0 * glossy,
        "leather": -0.3 * rough + 1.0 * brown * dark,
        "metal": 0.8 * glossy * grey,
        "wood": 0.5 * brown,
        "paper": -0.6 * rough + (0.5 * grey if seen.lightness > 80.0 else 0.0),
    }
    return {material: STRENGTH * float(cue) for material, cue in cues.items()}


def _near(angle: float, centre: float, width: float) -> float:
    """One at the centre, zero from `width` degrees on."""
    apart = abs((angle - centre + 180.0) % 360.0 - 180.0)
    return max(0.0, 1.0 - apart / width)
