"""A grip that gives way under load."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from model.gap.bodies.neighbours import hanging_together
from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, mass_of, no_grip
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.forces.controller import ControllerSpring
from model.simulator.parameters import Constant, TensorLike
from model.simulator.system import System


class SlippingGrip(AxialForce):
    r"""An anchor that drifts.

    $f = -k\,s$ with $\dot s = r\,\mathrm{sgn}(e)\max(0, |e| - F/k)$, $e = |d| - L - s$: what is pulled out of
    a hand is pushed back into it by as much force.

    Args:
        stiffness: k [N/m] of the controller spring, shape [controller_spring_count].
        slip_rate: r [1/s], shape [controller_spring_count].
        holding_force: F [N], under which nothing slips, shape [controller_spring_count].

    Reference:
        Perzyna (1966), Fundamental problems in viscoplasticity, Advances in applied mechanics 9 (overstress
        flow), here of the anchor.
    """

    name = "grip_slip"
    where = "controllers"
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "controllers", (100.0, 1e5)),
        "slip_rate": Constant("1/s", "controllers", (0.0, 1000.0)),
        "holding_force": Constant("N", "controllers", (0.01, 1.0)),
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
        elastic, most = length - rest_length - slip, holding_force / stiffness
        over = torch.relu(elastic - most) - torch.relu(-elastic - most)
        return -stiffness * slip, slip + (1.0 - torch.exp(-slip_rate * dt)) * over


class GripSlip(Effect):
    """Where the hand pulls harder than it can hold, the object slides through it."""

    name = "grip_slip"
    source = SlippingGrip.__doc__ or ""
    acts = "grip"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "slip_speed": Quantity("m/s", (1e-3, 10.0), 0.03, log=True),
        "load_limit": Quantity("weights", (0.01, 10.0), 0.5, log=True),
    }
    absent: ClassVar[Mapping[str, float]] = {"slip_speed": 0.0}
    grid: ClassVar[Grid] = {"load_limit": (0.1, 0.5, 1.2)}
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
        """Let each hand slide beyond so many weights of the object, so fast for every weight more.

        Its springs give way together, each with a share of the load that is its share of the stiffness: equal
        limits would leave all load on the faint springs around a firm hand. How stiff a hand is, which
        recordings hardly tell, does not say how it slides.
        """
        grip = world.simulator.force("controller_spring")
        assert isinstance(grip, ControllerSpring)
        hand = hands(world.system)
        # one may be told for all of them
        stiffness = grip.value("stiffness").double() * torch.ones(len(hand), dtype=torch.float64)
        mass, gravity = mass_of(world).detach().double(), world.gravity.double()
        # of each of many worlds its own: another effect may have given them other masses, or a tilted gravity
        weight = mass.sum(-1, keepdim=mass.ndim > 1) * gravity.norm(dim=-1, keepdim=gravity.ndim > 1)
        firmness = _of_hand(stiffness, hand)
        rate = values["slip_speed"] * firmness / weight
        holding = values["load_limit"] * weight * stiffness / firmness
        return world.with_force(SlippingGrip(grip.value("stiffness"), rate, holding))

    def strength(self, world: World, values: Values, where: Field | None = None) -> Field:
        """The points that are held, each by how firmly: a hand fades out over a few of them."""
        grip = world.simulator.force("controller_spring")
        assert isinstance(grip, ControllerSpring)
        edges = world.system.edges
        points = edges.first[edges.spring_count :]
        firmness = grip.value("stiffness").detach().double().expand(len(points))
        held = torch.zeros(len(world.system.points), dtype=torch.float64)
        return held.scatter_reduce(0, points, firmness / firmness.max(), "amax")


def hands(system: System) -> Int64[Tensor, " S"]:
    """Which hand each spring of the grip is of, counted from 0: of one are held points that springs join."""
    edges = system.edges
    ends = torch.stack([edges.first, edges.second], 1).cpu().numpy()
    springs, grip = np.split(ends, [edges.spring_count])
    between_held = springs[np.isin(springs, grip[:, 0]).all(1)]
    part = hanging_together(np.concatenate([between_held, grip]), edges.node_count)[grip[:, 0]]
    return torch.from_numpy(np.unique(part, return_inverse=True)[1].astype(np.int64))


def _of_hand(stiffness: Float64[Tensor, "*b S"], hand: Int64[Tensor, " S"]) -> Float64[Tensor, "*b S"]:
    """Stiffness of the whole hand of each spring [N/m]."""
    index = hand.expand(stiffness.shape)
    whole = torch.zeros_like(stiffness).scatter_add(-1, index, stiffness)
    return whole.gather(-1, index)
