"""Lamps and windows, and what surfaces make of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int

from model.scenes.looks.base import Finish
from model.types import Array

INSIDE = 0.6
"""Cosine to the lamp of what has no normal."""
BURIED = 0.02
"""Height above the ground [m] within which little light comes from below."""
SKY, FLOOR = 1.0, 0.45
"""How bright the room is above and below, in ambient light."""


@dataclass(frozen=True)
class Light:
    """One large lamp or window, and light from all around."""

    towards: tuple[float, float, float]
    """Unit vector to the lamp."""
    strength: float
    ambient: float
    color: tuple[float, float, float]
    """Of the lamp, around 1."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Light":
        """A lamp somewhere above; daylight to tungsten."""
        height, around = rng.uniform(0.6, 1.25), rng.uniform(0, 2 * np.pi)
        warmth = rng.normal(0, 0.05)
        towards = (np.cos(height) * np.cos(around), np.cos(height) * np.sin(around), np.sin(height))
        return cls(
            towards=(float(towards[0]), float(towards[1]), float(towards[2])),
            strength=float(rng.uniform(0.42, 0.62)),
            ambient=float(rng.uniform(0.42, 0.58)),
            color=(float(1 + warmth), 1.0, float(1 - warmth)),
        )


def lit(
    albedo: Float[Array, "G 3"],
    normals: Float[Array, "G 3"],
    views: Float[Array, "G 3"],
    heights: Float[Array, " G"],
    finishes: Sequence[Finish],
    label: Int[Array, " G"],
    light: Light,
) -> Float32[Array, "G 3"]:
    """Colours of surfaces: soft light, a room that glossy ones mirror, fibres that glow at the edge.

    Args:
        albedo: RGB, 0..1.
        normals: Unit; zero: of something inside, seen through a gap.
        views: Unit vectors to the camera.
        heights: Above the ground [m].
        finishes: What there is.
        label: Which of the finishes each has.
        light: The lamp and the room.

    Reference:
        Schlick (1994), An inexpensive BRDF model for physically-based rendering (its Fresnel term).
    """
    specular, gloss, sheen, wrap, metallic = (
        np.array([getattr(finish, name) for finish in finishes], np.float64)[label]
        for name in ("specular", "gloss", "sheen", "wrap", "metallic")
    )
    solid = normals.any(axis=1)
    facing = np.where(solid, normals @ np.array(light.towards), INSIDE)
    grazing = np.clip(1 - np.abs((normals * views).sum(axis=1)), 0, 1)
    diffuse = np.clip((facing + wrap) / (1 + wrap), 0, 1)
    sky = FLOOR + (SKY - FLOOR) * (1 + normals[:, 2]) / 2
    buried = (1 - normals[:, 2]) / 2 * np.exp(-np.maximum(heights, 0) / BURIED)
    lamp = np.array(light.color)
    matt = light.ambient * sky[:, None] + light.strength * diffuse[:, None] * lamp
    matt = matt * (1 - 0.6 * buried)[:, None] * (1 - 0.75 * metallic)[:, None]
    mirrored = _mirrored(normals, views, gloss, light)
    fresnel = solid * (specular + (1 - specular) * grazing**5 * gloss)
    tint = np.where(metallic[:, None] > 0, albedo, 1.0)
    shine = (fresnel * mirrored)[:, None] * tint * lamp
    edge = (solid * sheen * grazing**2)[:, None] * (0.5 + 0.5 * albedo)
    colors: Float32[Array, "G 3"] = np.clip(albedo * matt + shine + edge * matt, 0, 1).astype(np.float32)
    return colors


def _mirrored(
    normals: Float[Array, "G 3"], views: Float[Array, "G 3"], gloss: Float64[Array, " G"], light: Light
) -> Float64[Array, " G"]:
    """Brightness of the room where a mirror would show it: the lamp, a dim sky, dark below."""
    along = (normals * views).sum(axis=1, keepdims=True)
    reflected = 2 * along * normals - views
    angle = np.arccos(np.clip(reflected @ np.array(light.towards), -1, 1))
    # The lamp is about 15° wide; dull surfaces smear it, and it gets weaker as it gets wider.
    width = 0.26 + 0.9 * (1 - gloss) ** 1.5
    lamp = np.exp(-((angle / width) ** 4)) * (0.26 / width) ** 0.7
    room = 0.12 + 0.55 / (1 + np.exp(-6 * (reflected[:, 2] - 0.25)))
    seen: Float64[Array, " G"] = 1.5 * lamp + gloss * room
    return seen
