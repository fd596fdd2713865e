"""What air does to a body that moves through it: to its points, and to the faces of a sheet."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.gap.effects.base import Field, mass_of, on_points
from model.gap.world import World
from model.simulator.forces.base import ForceTerm, Scalar
from model.simulator.forces.vectors import Vector, cross, dot, minus, plus, times
from model.simulator.structure import faces

SLOWEST = 1e-6
"""Speed [m/s] below which air does not resist; keeps the root differentiable."""
SMALLEST = 1e-12
"""Twice the area [m²] of a face that has no normal."""


@dataclass(frozen=True)
class Met:
    """What the air meets: points, or faces of three."""

    stencils: Int[Tensor, "count size"]
    mass: Float[Tensor, "*b count"]
    """Of each [kg]."""


def on_point(seen: Vector, coefficient: Scalar) -> tuple[Vector, ...]:
    """Force [N] on a point past which air moves at a velocity `seen` [m/s], alike from all sides."""
    speed = torch.sqrt(dot(seen, seen) + SLOWEST**2)
    return (times(coefficient * speed, seen),)


def on_face(
    positions: tuple[Vector, ...], seen: Vector, coefficient: Scalar, facing: Scalar
) -> tuple[Vector, ...]:
    r"""Force [N] on the corners of a triangle past which air moves, a third on each.

    $F = c\,\lVert u\rVert\,\big((1-\varphi)\,u + \varphi\,(u\cdot n)\,n\big)$: with φ = 1 it presses along
    the normal n alone, with φ = 0 the face is met as points are.
    """
    normal = cross(minus(positions[1], positions[0]), minus(positions[2], positions[0]))
    along = dot(seen, normal) / (dot(normal, normal) + SMALLEST**2)
    speed = torch.sqrt(dot(seen, seen) + SLOWEST**2)
    pressed = plus(times(1.0 - facing, seen), times(facing * along, normal))
    third = times(coefficient * speed / 3.0, pressed)
    return third, third, third


def of_face(velocities: tuple[Vector, ...]) -> Vector:
    """Velocity [m/s] of a triangle's middle."""
    return times(1.0 / 3.0, plus(plus(velocities[0], velocities[1]), velocities[2]))


def in_air(
    world: World,
    drag_per_mass: Tensor,
    where: Field | None,
    on_points_alone: Callable[[Tensor, Tensor], ForceTerm],
    on_faces: Callable[[Tensor, Tensor], ForceTerm],
) -> World:
    """The world with what air does to it.

    Args:
        world: Without it.
        drag_per_mass: [1/m].
        where: How strongly it acts on each mass point, 0..1; None: on all alike.
        on_points_alone: The force on points, by their indices and coefficients [kg/m].
        on_faces: The same on faces.
    """
    for met, force in zip(met_by_air(world, where), (on_points_alone, on_faces), strict=True):
        if len(met.stencils):
            world = world.with_force(force(met.stencils, drag_per_mass * met.mass.to(drag_per_mass)))
    return world


def met_by_air(world: World, where: Field | None = None) -> tuple[Met, Met]:
    """Points that the air meets alike from all sides, and faces: all of a net is met by its faces."""
    mass = on_points(world, where) * mass_of(world)
    places = world.system.points.double().numpy()
    corners = torch.from_numpy(faces(places, world.system.springs.numpy()))
    uses = torch.bincount(corners.reshape(-1), minlength=len(places))
    each = mass / uses.clamp(min=1)
    alone = torch.from_numpy(np.flatnonzero(uses == 0))
    return Met(alone[:, None], mass[..., alone]), Met(corners, each[..., corners].sum(-1))


def has_faces(world: World) -> bool:
    """Whether air meets any of it by faces, as it does a net."""
    return bool(len(met_by_air(world)[1].stencils))
