"""A case with parameters → how its observed points move."""

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from model.errors import InputError
from model.scenes.case import Anchors, Case
from model.simulator.build import build_simulator
from model.simulator.parameters import TensorLike
from model.simulator.simulator import Lead, Simulator
from model.types import Array, Observation, Parameters, Topology


def case_simulator(case: Case, parameters: Parameters, *, self_contact: bool = False) -> Simulator:
    """The case's topology with these parameters, held and pulled as the case says.

    Args:
        case: Topology, gravity and ground.
        parameters: Of its springs; per spring, in the order of the topology.
        self_contact: Also resolve contacts of the object with itself.
    """

    def scalar(name: str) -> float:
        value = parameters.globals[name].value
        if isinstance(value, tuple):
            raise InputError(f"case {case.name}: {name}: expected one number, found {len(value)}")
        return value

    return topology_simulator(
        case.topology,
        case.observation,
        stiffness=parameters.stiffness,
        controller_stiffness=parameters.controller_stiffness,
        dashpot_damping=scalar("dashpot_damping"),
        drag_rate=scalar("drag_rate"),
        friction=scalar("friction"),
        restitution=scalar("restitution"),
        collision_distance=scalar("collision_distance") if self_contact else None,
    )


def topology_simulator(
    topology: Topology,
    seen: Observation,
    *,
    stiffness: TensorLike,
    controller_stiffness: TensorLike,
    dashpot_damping: TensorLike,
    drag_rate: TensorLike = 0.0,
    friction: TensorLike = 0.0,
    restitution: TensorLike = 0.0,
    collision_distance: float | None = None,
) -> Simulator:
    """A topology under the gravity and over the ground of what was seen; tensors keep their gradients.

    Args:
        topology: Points, springs and what holds them.
        seen: Its gravity and its ground.
        stiffness: Of the springs [N/m]; see `build_simulator` for this and what follows.
        controller_stiffness: [N/m].
        dashpot_damping: [N·s/m].
        drag_rate: [1/s].
        friction: [1].
        restitution: [1].
        collision_distance: [m]; None: no contact of the object with itself.
    """
    return build_simulator(
        points=topology.points,
        mass=topology.mass,
        springs=topology.springs,
        rest_length=topology.rest_length,
        stiffness=stiffness,
        controller_springs=topology.controller_springs,
        controller_rest_length=topology.controller_rest_length,
        controller_stiffness=controller_stiffness,
        controller_points=topology.controller_points,
        dashpot_damping=dashpot_damping,
        drag_rate=drag_rate,
        friction=friction,
        restitution=restitution,
        collision_distance=collision_distance,
        gravity=seen.gravity,
        ground_height=seen.ground_height,
    )


def replay(case: Case, parameters: Parameters, frames: int | None = None) -> Float32[Array, "T N 3"]:
    """Where the observed points are [m] in the first `frames` frames (None: all) under the case's controls.

    Raises:
        SimulationDiverged: a state is not finite.
    """
    simulator = case_simulator(case, parameters)
    with torch.no_grad():
        points = roll(case, simulator, frames)
        return observed(case.anchors, points).numpy().astype(np.float32)


def roll(
    case: Case,
    simulator: Simulator,
    frames: int | None = None,
    *,
    substeps: int | None = None,
    checkpoint: bool = False,
    lead: Lead | None = None,
) -> Float[Tensor, "T *b P 3"]:
    """Roll a simulator of the case out from rest under its controls: mass points [m], with gradients."""
    seen = case.observation
    motion = torch.as_tensor(seen.controllers[:frames]) if seen.controllers.shape[1] else None
    times = seen.times[:frames]
    return simulator.rollout(
        None, motion, times=times, substeps=substeps, checkpoint=checkpoint, lead=lead
    ).points


def observed(anchors: Anchors, points: Float[Tensor, "T *b P 3"]) -> Float[Tensor, "T *b N 3"]:
    """Where the observed points are [m] when the mass points are at `points` [m]."""
    index = torch.as_tensor(anchors.index, dtype=torch.long)
    weight = torch.as_tensor(anchors.weight).to(points)
    return (points[..., index, :] * weight[..., None]).sum(dim=-2)
