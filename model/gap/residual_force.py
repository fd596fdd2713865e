"""A force that stands for physics nobody has named: local, the same wherever the body is, and learned.

A hidden layer of a few fixed units sees a spring, a point, the ground or the grip; how much of each unit the
force has is learned. So few numbers a Gauss-Newton fit finds from one recording within seconds, as descent
along the gradient of a deeper network would not.

Reference:
    Rahimi and Recht (2008), Weighted sums of random kitchen sinks, Advances in neural information processing
    systems 21 (fixed hidden units with learned weights approximate as a trained layer does).
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.effects.base import (
    Effect,
    Field,
    Quantity,
    Values,
    mass_of,
    no_grip,
    no_ground,
    no_springs,
    spring_stiffness,
)
from model.gap.plain import DAMPED
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.forces.bending import Bending
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.vectors import Vector, dot
from model.simulator.parameters import Constant
from model.simulator.structure import cells, rows, spans, turns
from model.types import Array

STRAIN = 0.1
"""At about this strain the units of a spring saturate."""
RATE = 3.0
"""At about this strain rate [1/s] as well."""
FAST, SLOW, LASTING = 0.1, 0.6, 3.0
"""Times [s] in which the memories of a spring follow its strain."""
STILL = 0.02
"""Speed [m/s] below which a point on the ground sticks."""
GRAVITY = 9.81
"""What forces on a point are measured in [m/s²]."""
BENDING = 0.05
"""Of a row, in stiffness × spacing³: about as much as the springs of a sheet resist."""
SPRING_UNITS = ("odd", "even", "fast", "slow", "lasting", "worn", "viscous", "along", "across")
AIR_UNITS = ("x", "y", "z", "drag")
MASS_MODES = ("heavy_1", "heavy_2", "heavy_3")


def _weights(names: tuple[str, ...], low: float = -2.0) -> dict[str, Quantity]:
    return {name: Quantity("1", (low, 2.0), 0.0) for name in names}


def _scene(names: tuple[str, ...]) -> dict[str, Constant]:
    return {name: Constant("1", "scene", (-0.5, 0.5), positive=False) for name in names}


def _bounded(value: Scalar) -> Scalar:
    """A sigmoid, -1..1, whose root and quotient take a fraction of the time of a hyperbolic tangent."""
    return value / torch.sqrt(1.0 + value * value)


class LearnedTension(AxialForce):
    r"""Of a spring: of its strain, its rate, what it remembers of its strain, and how it lies in the body.

    $f = k L \sum_i w_i h_i$ over units $h_i$ that vanish at rest.

    Args:
        values: Stiffness k [N/m], how the spring lies along and across the body, and a weight for each unit.
    """

    name = "learned_tension"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "lies_along": Constant("1", "springs", (-0.4, 0.6), positive=False),
        "lies_across": Constant("1", "springs", (-0.4, 0.6), positive=False),
        **_scene(SPRING_UNITS),
    }
    memory: ClassVar[Mapping[str, float]] = {
        "fast_strain": 0.0,
        "slow_strain": 0.0,
        "lasting_strain": 0.0,
        "largest_strain": 0.0,
    }

    @staticmethod
    def law(
        length: Scalar,
        rate: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        lies_along: Scalar,
        lies_across: Scalar,
        odd: Scalar,
        even: Scalar,
        fast: Scalar,
        slow: Scalar,
        lasting: Scalar,
        worn: Scalar,
        viscous: Scalar,
        along: Scalar,
        across: Scalar,
        fast_strain: Scalar,
        slow_strain: Scalar,
        lasting_strain: Scalar,
        largest_strain: Scalar,
        dt: Scalar,
    ) -> tuple[Scalar, ...]:
        """Tension [N], and what the spring remembers after `dt`."""
        strain = (length / rest_length - 1.0) / STRAIN
        size = torch.sqrt(strain * strain + 1e-4) - 1e-2
        felt = (
            odd * _bounded(strain)
            + even * size
            + fast * _bounded(strain - fast_strain)
            + slow * _bounded(strain - slow_strain)
            + lasting * _bounded(strain - lasting_strain)
            + worn * strain * _bounded(largest_strain)
            + viscous * _bounded(rate / rest_length / RATE)
            + (along * lies_along + across * lies_across) * strain
        )
        followed = (
            memory + dt / (time + dt) * (strain - memory)
            for memory, time in ((fast_strain, FAST), (slow_strain, SLOW), (lasting_strain, LASTING))
        )
        faded = largest_strain * LASTING / (LASTING + dt)
        return stiffness * rest_length * STRAIN * felt, *followed, faded + torch.relu(size - faded)


class LearnedAir(StencilForce):
    """Of a point: a steady push, and drag with the square of its speed.

    Args:
        stencils: The points, shape [count, 1].
        values: Mass [kg] of each, and a weight for each unit.
    """

    name = "learned_air"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "weight": Constant("kg", "stencils", (0.01, 1.0)),
        **_scene(AIR_UNITS),
    }

    @staticmethod
    def law(
        velocities: tuple[Vector, ...], weight: Scalar, x: Scalar, y: Scalar, z: Scalar, drag: Scalar
    ) -> tuple[Vector, ...]:
        """Force [N] on the point."""
        own = velocities[0]
        speed = torch.sqrt(dot(own, own) + 1e-12)
        push = zip((x, y, z), own, strict=True)
        return (tuple(weight * (GRAVITY * steady - drag * speed * part) for steady, part in push),)


class LearnedGround(StencilForce):
    """Of a point near the ground: it holds what slides slowly, and pulls at what leaves it.

    Args:
        stencils: The points, shape [count, 1].
        values: Mass [kg] of each, the height of the ground [m], how far it reaches [m], and the weights.
    """

    name = "learned_ground"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "weight": Constant("kg", "stencils", (0.01, 1.0)),
        "reach": Constant("m", "scene", (0.05, 0.1)),
        "height": Constant("m", "scene", (-0.1, 0.0), positive=False),
        **_scene(("stick", "pull")),
    }

    @staticmethod
    def law(
        positions: tuple[Vector, ...],
        velocities: tuple[Vector, ...],
        weight: Scalar,
        reach: Scalar,
        height: Scalar,
        stick: Scalar,
        pull: Scalar,
    ) -> tuple[Vector, ...]:
        """Force [N] on the point."""
        x, y, _ = velocities[0]
        above = torch.relu(positions[0][2] - height) / reach
        slip = torch.sqrt(x * x + y * y + 1e-12)
        held = weight * GRAVITY * stick * torch.exp(-above * above) * _bounded(slip / STILL) / slip
        return ((-held * x, -held * y, -weight * GRAVITY * pull * above * torch.exp(1.0 - above)),)


class LearnedGrip(AxialForce):
    """Of a spring of the hand: what it loses as it stays stretched.

    Args:
        values: Stiffness [N/m] of the spring, and the weight of the one unit.
    """

    name = "learned_grip"
    where = "controllers"
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "controllers", (100.0, 1e5)),
        **_scene(("slip",)),
    }
    memory: ClassVar[Mapping[str, float]] = {"slow_stretch": 0.0}

    @staticmethod
    def law(
        length: Scalar, rest_length: Scalar, stiffness: Scalar, slip: Scalar, slow_stretch: Scalar, dt: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Tension [N], and how far the spring has been stretched lately [m]."""
        stretch = length - rest_length
        after = slow_stretch + dt / (SLOW + dt) * (stretch - slow_stretch)
        return -stiffness * slip * slow_stretch, after


class LearnedBending(Bending):
    """Beside any bending stiffness that the twin has."""

    name = "learned_bending"


class ResidualMaterial(Effect):
    """Springs pull by what they have learned."""

    name = "residual_material"
    source = LearnedTension.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = _weights(SPRING_UNITS)
    absent: ClassVar[Mapping[str, float]] = dict.fromkeys(SPRING_UNITS, 0.0)
    terms = (LearnedTension,)

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_springs(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Add to every spring."""
        along, across = _lies(world).T
        stiffness = spring_stiffness(world)
        weights = {**values, "viscous": values["viscous"] * _viscous_share(world, stiffness)}
        return world.with_force(
            LearnedTension(stiffness=stiffness, lies_along=along, lies_across=across, **weights)
        )


def _viscous_share(world: World, stiffness: Float[Tensor, "*b E"]) -> Tensor:
    """What the unit of a rate counts: no more than a dashpot may, or stiff springs need too many steps."""
    usual = stiffness.mean(-1, keepdim=stiffness.ndim > 1).clamp_min(1e-9)
    most = DAMPED * 2.0 * torch.sqrt(usual * mass_of(world).mean())
    return torch.clamp(most / (usual * STRAIN / RATE), max=1.0)


class ResidualAir(Effect):
    """Points are pushed and slowed, and parts of the body are heavier than others."""

    name = "residual_air"
    source = LearnedAir.__doc__ or ""
    acts = "surroundings"
    quantities: ClassVar[Mapping[str, Quantity]] = _weights((*AIR_UNITS, *MASS_MODES))
    absent: ClassVar[Mapping[str, float]] = dict.fromkeys((*AIR_UNITS, *MASS_MODES), 0.0)
    terms = (LearnedAir,)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Put the body there."""
        mass = mass_of(world)
        modes = _along_axes(world.system.points.double().numpy())
        heavier = sum(values[name] * torch.from_numpy(modes[:, i]) for i, name in enumerate(MASS_MODES))
        world = world.with_system(world.system.with_values(mass=mass * torch.exp(torch.as_tensor(heavier))))
        points = torch.arange(len(world.system.points)).unsqueeze(-1)
        return world.with_force(LearnedAir(points, weight=mass, **{name: values[name] for name in AIR_UNITS}))


class ResidualGround(Effect):
    """The ground holds and pulls."""

    name = "residual_ground"
    source = LearnedGround.__doc__ or ""
    acts = "ground"
    quantities: ClassVar[Mapping[str, Quantity]] = _weights(("stick", "pull"))
    absent: ClassVar[Mapping[str, float]] = {"stick": 0.0, "pull": 0.0}
    terms = (LearnedGround,)

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_ground(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Within a part of the spacing."""
        assert world.ground_height is not None
        points = torch.arange(len(world.system.points)).unsqueeze(-1)
        height, reach = world.ground_height, 0.25 * world.spacing
        return world.with_force(
            LearnedGround(points, weight=mass_of(world), height=height, reach=reach, **values)
        )


class ResidualGrip(Effect):
    """The hand gives way."""

    name = "residual_grip"
    source = LearnedGrip.__doc__ or ""
    acts = "grip"
    quantities: ClassVar[Mapping[str, Quantity]] = _weights(("slip",))
    absent: ClassVar[Mapping[str, float]] = {"slip": 0.0}
    terms = (LearnedGrip,)

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_grip(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Wherever it holds."""
        grip = world.simulator.force("controller_spring")
        assert isinstance(grip, ControllerSpring)
        return world.with_force(LearnedGrip(stiffness=grip.value("stiffness"), slip=values["slip"]))


class ResidualBending(Effect):
    """Rows of points of what is thin resist bending."""

    name = "residual_bending"
    source = Bending.__doc__ or ""
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = _weights(("resistance",), low=0.0)
    absent: ClassVar[Mapping[str, float]] = {"resistance": 0.0}
    terms = (LearnedBending,)

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        points, springs = world.system.points.double().numpy(), world.system.springs.numpy()
        if len(cells(points, world.spacing)[0]):
            return "a solid bends by its springs"
        return None if len(rows(points, springs)) else "no three points are in a row"

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """At rest as the body is."""
        points, spacing = world.system.points.double().numpy(), world.spacing
        usual = spring_stiffness(world).detach().mean(-1, keepdim=True)
        triples = rows(points, world.system.springs.numpy())
        rigidity = BENDING * values["resistance"] * usual * spacing**3
        return world.with_force(
            LearnedBending(
                torch.from_numpy(triples),
                bending_stiffness=rigidity.expand(*rigidity.shape[:-1], len(triples)),
                span=spans(points, triples),
                rest_turn=torch.from_numpy(turns(points, triples)),
            )
        )


RESIDUAL: tuple[type[Effect], ...] = (
    ResidualMaterial,
    ResidualAir,
    ResidualGround,
    ResidualGrip,
    ResidualBending,
)
"""Together they are the flexible force; no catalogue lists them."""


def _lies(world: World) -> Float64[Tensor, "E 2"]:
    """How each spring lies along the two longest axes of the body at rest: cos² less what chance gives."""
    points, springs = world.system.points.double().numpy(), world.system.springs.numpy()
    way = points[springs[:, 1]] - points[springs[:, 0]]
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    return torch.from_numpy((way @ _axes(points)[:2].T) ** 2 - 1.0 / 3.0)


def _along_axes(points: Float64[Array, "P 3"]) -> Float64[Array, "P 3"]:
    """Places along the axes of the body, -1..1 over its length."""
    away = points - points.mean(0)
    placed: Float64[Array, "P 3"] = (
        away @ _axes(points).T / max(float(np.linalg.norm(away, axis=1).max()), 1e-9)
    )
    return placed


def _axes(points: Float64[Array, "P 3"]) -> Float64[Array, "3 3"]:
    axes: Float64[Array, "3 3"] = np.linalg.svd(points - points.mean(0), full_matrices=False)[2]
    return axes
