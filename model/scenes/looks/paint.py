"""Gaussians in the colours of what they are made of."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float64, Int

from model.errors import InputError
from model.priors.materials import MATERIALS
from model.scenes.looks.base import Look
from model.scenes.looks.denim import Denim
from model.scenes.looks.fabric import Fabric
from model.scenes.looks.fur import Fur
from model.scenes.looks.leather import Leather
from model.scenes.looks.metal import Metal
from model.scenes.looks.paper import Paper
from model.scenes.looks.plastic import Plastic
from model.scenes.looks.rubber import Rubber
from model.scenes.looks.silk import Silk
from model.scenes.looks.wood import Wood
from model.types import Array, Gaussians, Parts

ALL_LOOKS: tuple[type[Look], ...] = (
    Fabric, Leather, Rubber, Plastic, Metal, Wood, Paper, Silk, Denim, Fur,
)  # fmt: skip
"""One per material."""
_OF = {look.material: look for look in ALL_LOOKS}


def paint(
    gaussians: Gaussians,
    parts: Parts,
    materials: Sequence[int] | Int[Array, " K"],
    rng: np.random.Generator,
) -> Gaussians:
    """Give every Gaussian the colour that its part's material has there; nothing else changes.

    Args:
        gaussians: The body, in any order.
        parts: Label per Gaussian.
        materials: Of each part, an index into `MATERIALS`.
        rng: For dyes and patterns; `wardrobe(name)`, and films of the object show the same ones.

    Raises:
        InputError: there are not as many materials as parts.
    """
    if len(materials) != parts.count:
        raise InputError(f"paint: {parts.count} parts but {len(materials)} materials; give one each")
    looks = [draw_look(int(material), rng) for material in materials]
    place = texture_place(gaussians.means, gaussians.means)
    return replace(gaussians, colors=albedos(looks, parts.labels, place).astype(np.float32))


def wardrobe(object_name: str) -> np.random.Generator:
    """The numbers that an object's look is drawn with: whoever paints or films it draws the same."""
    digest = hashlib.sha256(f"looks of {object_name}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "little"))


def draw_look(material: int, rng: np.random.Generator) -> Look:
    """A piece of a material, by its index into `MATERIALS`."""
    return _OF[MATERIALS[material]].draw(rng)


def albedos(
    looks: Sequence[Look], labels: Int[Array, " P"], place: Float64[Array, "P 3"]
) -> Float64[Array, "P 3"]:
    """Colour of each place [m] that belongs to the look of its label."""
    colors = np.zeros((len(place), 3))
    for label, look in enumerate(looks):
        mine = labels == label
        if mine.any():
            colors[mine] = look.albedo(place[mine])
    return colors


def texture_place(points: Float[Array, "P 3"], body: Float[Array, "G 3"]) -> Float64[Array, "P 3"]:
    """Where points are in a frame of the body's own [m], so that its texture stays when it is laid elsewhere.

    Centred, the longest axis first; the sense of an axis is that of the longer tail.
    """
    centre = body.astype(np.float64).mean(axis=0)
    offset = body - centre
    axes = np.linalg.eigh(offset.T @ offset)[1][:, ::-1]
    sense = np.sign(((offset @ axes) ** 3).sum(axis=0))
    place: Float64[Array, "P 3"] = (points - centre) @ (axes * np.where(sense == 0, 1.0, sense))
    return place
