"""A body made of Gaussians, dressed in what it is made of: fine discs, hairs where there is a pile."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float32, Float64, Int, Int32

from model.scenes.looks.base import Look
from model.scenes.looks.paint import albedos, texture_place
from model.scenes.looks.surface import Surface, surface_of
from model.scenes.splats import together, turned_to
from model.types import Array, Gaussians

OPACITY, HAIR_OPACITY = 0.95, 0.85
HAIRS = 2
"""Per disc."""
FILLING = 0.5
"""Size of the Gaussians inside over those that they were."""
COMBED = np.array([0.25, 0.1, -0.35])
"""How hairs lean, over their length."""


@dataclass(frozen=True)
class Dress:
    """What a camera sees of a body at rest."""

    gaussians: Gaussians
    """Their colours are the albedo."""
    normals: Float32[Array, "G 3"]
    """For the light: outward, unit, with the material's relief; zero inside the body."""
    outward: Float32[Array, "G 3"]
    """Away from the inside of the body, unit: what looks away from the camera is not seen; zero inside."""
    label: Int32[Array, " G"]
    """Which look each wears."""


def dress(
    body: Gaussians,
    labels: Int[Array, " B"],
    looks: Sequence[Look],
    spacing: float,
    rng: np.random.Generator,
    known: Float[Array, "N 3"] | None = None,
) -> Dress:
    """Cover a body.

    Args:
        body: Gaussians that fill it.
        labels: Which of the looks each of them wears.
        looks: Materials.
        spacing: About how far apart the discs shall be [m].
        rng: For where discs and hairs are.
        known: Points on its surface [m], if any.
    """
    surface = surface_of(body, spacing, rng, known)
    label = labels[surface.owner].astype(np.int32)
    skin = _both(
        _worn(_discs(surface), surface.normals, label, looks, body),
        _worn(_filling(body), np.zeros(body.means.shape), labels.astype(np.int32), looks, body),
    )
    piles = np.array([look.finish.pile for look in looks])
    hairy = np.repeat(np.flatnonzero(piles[label] > 0), HAIRS)
    if not len(hairy):
        return skin
    gaussians, normals = _hairs(surface, hairy, piles[label[hairy]], rng)
    return _both(skin, _worn(gaussians, normals, label[hairy], looks, body))


def _worn(
    gaussians: Gaussians,
    normals: Float64[Array, "G 3"],
    label: Int32[Array, " G"],
    looks: Sequence[Look],
    body: Gaussians,
) -> Dress:
    place = texture_place(gaussians.means, body.means)
    relief = np.zeros_like(place)
    for number, look in enumerate(looks):
        mine = label == number
        if mine.any():
            relief[mine] = look.relief(place[mine])
    rough = np.where(normals.any(axis=1, keepdims=True), normals + relief, 0.0)
    rough /= np.maximum(np.linalg.norm(rough, axis=1, keepdims=True), 1e-9)
    colors = np.clip(albedos(looks, label, place) * gaussians.colors, 0, 1).astype(np.float32)
    return Dress(
        replace(gaussians, colors=colors), rough.astype(np.float32), normals.astype(np.float32), label
    )


def _discs(surface: Surface) -> Gaussians:
    count, spacing = len(surface.points), surface.spacing
    return Gaussians(
        means=surface.points.astype(np.float32),
        scales=np.tile(np.float32(spacing) * np.array([0.75, 0.75, 0.3], np.float32), (count, 1)),
        quaternions=turned_to(surface.normals).astype(np.float32),
        opacities=np.full(count, OPACITY, np.float32),
        colors=np.ones((count, 3), np.float32),
        volumes=np.full(count, spacing**3, np.float32),
    )


def _filling(body: Gaussians) -> Gaussians:
    """What is seen through gaps between discs: the body's own Gaussians, drawn in."""
    return replace(
        body,
        scales=FILLING * body.scales,
        opacities=np.full(len(body), OPACITY, np.float32),
        colors=np.ones_like(body.colors),
    )


def _hairs(
    surface: Surface, roots: Int[Array, " H"], length: Float64[Array, " H"], rng: np.random.Generator
) -> tuple[Gaussians, Float64[Array, "H 3"]]:
    """Thin Gaussians that lean as they were combed; some longer, some darker."""
    normals = surface.normals[roots]
    lean = normals + COMBED + rng.normal(0, 0.35, normals.shape)
    inward = np.minimum((lean * normals).sum(axis=1, keepdims=True) - 0.3, 0)
    lean = lean - inward * normals
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    length = length * rng.uniform(0.5, 1.2, len(roots))
    scatter = rng.normal(0, 0.5 * surface.spacing, normals.shape)
    means = surface.points[roots] + scatter + 0.45 * length[:, None] * lean
    thin = np.full(len(roots), 0.32 * surface.spacing)
    brightness = np.clip(rng.normal(1.0, 0.14, (len(roots), 1)), 0.5, 1.4)
    gaussians = Gaussians(
        means=means.astype(np.float32),
        scales=np.stack([thin, thin, 0.32 * length], axis=1).astype(np.float32),
        quaternions=turned_to(lean).astype(np.float32),
        opacities=np.full(len(roots), HAIR_OPACITY, np.float32),
        colors=np.repeat(brightness, 3, axis=1).astype(np.float32),
        volumes=np.full(len(roots), surface.spacing**3 / 8, np.float32),
    )
    return gaussians, normals


def _both(skin: Dress, pile: Dress) -> Dress:
    return Dress(
        together(skin.gaussians, pile.gaussians),
        np.concatenate([skin.normals, pile.normals]),
        np.concatenate([skin.outward, pile.outward]),
        np.concatenate([skin.label, pile.label]),
    )
