"""A grip that gives way under load."""

from collections.abc import Mapping
from typing import ClassVar

import torch

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, no_grip
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.forces.controller import ControllerSpring
from model.simulator.parameters import Constant, TensorLike


class SlippingGrip(AxialForce):
    r"""An anchor that drifts: $f = -k\,s$, $\dot s = r\max(0,\ |d| - L - s - F/k)$.

    Args:
        stiffness: k [N/m] of the controller spring, shape [controller_spring_count].
        slip_rate: r [1/s].
        holding_force: F [N], under which nothing slips.

    Reference:
        Perzyna (1966), Fundamental problems in viscoplasticity, Advances in applied mechanics 9 (overstress
        flow), here of the anchor and in tension alone.
    """

    name = "grip_slip"
    where = "controllers"
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "controllers", (100.0, 1e5)),
        "slip_rate": Constant("1/s", "scene", (0.0, 100.0)),
        "holding_force": Constant("N", "scene", (0.01, 1.0)),
    }
    memory: ClassVar[Mapping[str, float]] = {"slip": 0.0}

    def __init__(self, stiffness: TensorLike, slip_rate: TensorLike, holding_force: TensorLike) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness, slip_rate=slip_rate, holding_force=holding_force)

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        slip_rate: Scalar,
        holding_force: Scalar,
        slip: Scalar,
        dt: Scalar,
    ) -> tuple[Scalar, Scalar]:
        """What the tension loses [N], and how far the anchor has drifted [m]."""
        over = torch.relu(length - rest_length - slip - holding_force / stiffness)
        return -stiffness * slip, slip + (1.0 - torch.exp(-slip_rate * dt)) * over


class GripSlip(Effect):
    """Where the hand pulls harder than it can hold, the object slides through it."""

    name = "grip_slip"
    source = SlippingGrip.__doc__ or ""
    acts = "grip"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "slip_rate": Quantity("1/s", (0.02, 100.0), 3.0, log=True),
        "load_limit": Quantity("weights per grip point", (0.01, 10.0), 0.5, log=True),
    }
    absent: ClassVar[Mapping[str, float]] = {"slip_rate": 0.0}
    grid: ClassVar[Grid] = {"load_limit": (0.05, 0.3, 1.5)}
    terms = (SlippingGrip,)
    confused_with: ClassVar[Mapping[str, str]] = {
        "plasticity": "grip it again",
        "actuation_delay": "hold it still under load",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act: what a grip holds is told in weights."""
        if float(world.gravity.norm()) == 0.0:
            return "nothing weighs it down, and a grip is told in weights"
        return no_grip(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let the anchors drift beyond a load, given in weights of the object over the springs of a grip."""
        grip = world.simulator.force("controller_spring")
        assert isinstance(grip, ControllerSpring)
        count = world.system.edges.controller_spring_count
        mass, gravity = mass_of(world).detach().double(), world.gravity.double()
        # of each of many worlds its own: another effect may have given them other masses, or a tilted gravity
        weight = mass.sum(-1, keepdim=mass.ndim > 1) * gravity.norm(dim=-1, keepdim=gravity.ndim > 1)
        holding = values["load_limit"] * weight / count
        return world.with_force(SlippingGrip(grip.value("stiffness"), values["slip_rate"], holding))

    def strength(self, world: World, values: Values, where: Field | None = None) -> Field:
        """The points that are held, each by how firmly: a hand fades out over a few of them."""
        grip = world.simulator.force("controller_spring")
        assert isinstance(grip, ControllerSpring)
        edges = world.system.edges
        points = edges.first[edges.spring_count :]
        firmness = grip.value("stiffness").detach().double().expand(len(points))
        held = torch.zeros(len(world.system.points), dtype=torch.float64)
        return held.scatter_reduce(0, points, firmness / firmness.max(), "amax")
