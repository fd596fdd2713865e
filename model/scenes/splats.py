"""Coloured bodies as Gaussians with normals, and their shading."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from model.scenes.capsules import Capsules
from model.types import Array, Gaussians

LIGHT = np.array([-0.35, -0.25, 0.9]) / np.linalg.norm([-0.35, -0.25, 0.9])
"""Towards the light."""
AMBIENT, DIFFUSE = 0.58, 0.48
OPACITY = 0.95


@dataclass(frozen=True)
class Coat:
    """Gaussians that fill a body, and the outward normal of those on its surface."""

    gaussians: Gaussians
    """Their colours are the albedo."""
    normals: Float32[Array, "G 3"]
    """Unit; zero inside the body."""


def coat(
    body: Capsules,
    albedo: Float64[Array, "P 3"],
    surface: Float64[Array, "P 3"],
    spacing: float,
    rng: np.random.Generator,
) -> Coat:
    """Discs on the surface in the given colours, balls inside in their mean colour.

    Args:
        body: The shape.
        albedo: RGB of each surface point, 0..1.
        surface: Points on the surface, about `spacing` apart.
        spacing: [m].
        rng: For where the inner points are.
    """
    inner = body.fill(2.5 * spacing, 1.5 * spacing, rng)
    _, normals = body.field(surface)
    disc, ball = (0.75 * spacing, 0.75 * spacing, 0.3 * spacing), (1.1 * spacing,) * 3
    count = len(surface) + len(inner)
    upright = np.tile([1.0, 0, 0, 0], (len(inner), 1))
    colors = np.concatenate([albedo, np.tile(albedo.mean(axis=0), (len(inner), 1))])
    gaussians = Gaussians(
        means=np.concatenate([surface, inner]).astype(np.float32),
        scales=np.concatenate([np.tile(disc, (len(surface), 1)), np.tile(ball, (len(inner), 1))]).astype(
            np.float32
        ),
        quaternions=np.concatenate([turned_to(normals), upright]).astype(np.float32),
        opacities=np.full(count, OPACITY, np.float32),
        colors=colors.astype(np.float32),
        volumes=np.full(count, spacing**3, np.float32),
    )
    return Coat(gaussians, np.concatenate([normals, np.zeros_like(inner)]).astype(np.float32))


def joined(*coats: Coat) -> Coat:
    """All of them as one, in this order."""
    return Coat(together(*(one.gaussians for one in coats)), np.concatenate([one.normals for one in coats]))


def together(*bodies: Gaussians) -> Gaussians:
    """All of them as one, in this order, without what depends on the direction of view."""
    return Gaussians(
        means=np.concatenate([body.means for body in bodies]),
        scales=np.concatenate([body.scales for body in bodies]),
        quaternions=np.concatenate([body.quaternions for body in bodies]),
        opacities=np.concatenate([body.opacities for body in bodies]),
        colors=np.concatenate([body.colors for body in bodies]),
        volumes=np.concatenate([body.volumes for body in bodies]),
    )


def turned_to(normals: Float64[Array, "P 3"]) -> Float64[Array, "P 4"]:
    """Quaternions (w x y z) that turn the z axis to each normal."""
    x, y, z = normals.T
    quaternion = np.stack([1 + z, -y, x, np.zeros_like(x)], axis=1)
    quaternion[z < -1 + 1e-9] = [0, 1, 0, 0]
    unit: Float64[Array, "P 4"] = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return unit


def lit(
    albedo: Float32[Array, "G 3"], normals: Float32[Array, "G 3"], means: Float32[Array, "G 3"]
) -> Float32[Array, "G 3"]:
    """Colours under a large lamp above: brighter towards it, darker close to the table below."""
    facing = AMBIENT + DIFFUSE * np.clip(normals @ LIGHT, -0.3, 1)
    buried = (1 - normals[:, 2]) / 2 * np.exp(-np.maximum(means[:, 2], 0) / 0.02)
    colors: Float32[Array, "G 3"] = np.clip(albedo * (facing * (1 - 0.6 * buried))[:, None], 0, 1)
    return colors.astype(np.float32)
