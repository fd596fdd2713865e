"""A simulator from the arrays of a twin bundle."""

import numpy as np
import torch
from torch import Tensor

from model.simulator.contacts.base import ContactTerm
from model.simulator.contacts.ground import Ground
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.forces.base import ForceTerm
from model.simulator.forces.bending_damping import BendingDamping
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.parameters import TensorLike
from model.simulator.simulator import Simulator
from model.simulator.system import System


def build_simulator(
    *,
    points: Tensor | np.ndarray,
    mass: TensorLike,
    springs: Tensor | np.ndarray,
    rest_length: TensorLike,
    stiffness: TensorLike,
    controller_springs: Tensor | np.ndarray | None = None,
    controller_rest_length: TensorLike | None = None,
    controller_stiffness: TensorLike | None = None,
    controller_points: Tensor | np.ndarray | None = None,
    dashpot_damping: TensorLike = 0.0,
    drag_rate: TensorLike = 0.0,
    friction: TensorLike = 0.0,
    restitution: TensorLike = 0.0,
    collision_distance: float | None = None,
    bending_decay: TensorLike = 0.0,
    gravity: TensorLike = (0.0, 0.0, -9.81),
    ground_height: TensorLike | None = None,
    dtype: torch.dtype = torch.float32,
) -> Simulator:
    """The simulator of design section 7, from the tensors of a bundle and its global parameters.

    Args:
        points: Rest positions [m], shape [N, 3].
        mass: [kg], shape [N].
        springs: Pairs of points, shape [E, 2].
        rest_length: [m], shape [E].
        stiffness: [N/m], shape [E].
        controller_springs: Pairs (controller, point), shape [S, 2]; None or empty: nothing is held.
        controller_rest_length: [m], shape [S].
        controller_stiffness: [N/m], shape [S].
        controller_points: Where the controllers are while no motion of them is given [m], shape [C, 3].
        dashpot_damping: [N·s/m], of springs and controller springs.
        drag_rate: [1/s].
        friction: [1], of the ground and of self-contact.
        restitution: [1], of the ground and of self-contact.
        collision_distance: Of self-contact [m]; None or 0: no self-contact.
        bending_decay: Rate at which zigzags between neighbouring points die out [1/s]; 0: they do not.
        gravity: [m/s²], shape [3].
        ground_height: z of the ground [m]; None: no ground.
        dtype: In which the simulator computes.

    Raises:
        InputError: arrays that do not fit each other; says which.
    """
    places = torch.as_tensor(points).to(dtype)
    system = System(
        points=places,
        mass=mass,
        springs=_indices(springs),
        rest_length=rest_length,
        controller_springs=_indices(controller_springs),
        controller_rest_length=controller_rest_length,
        controller_points=None if controller_points is None else torch.as_tensor(controller_points).to(dtype),
    )
    forces: list[ForceTerm] = [Spring(stiffness), Dashpot(dashpot_damping), Gravity(gravity), Drag(drag_rate)]
    if controller_stiffness is not None and system.controller_count:
        forces.insert(1, ControllerSpring(controller_stiffness))
    if isinstance(bending_decay, Tensor) or bending_decay:
        forces.append(_calming(system, bending_decay))
    contacts: list[ContactTerm] = []
    if collision_distance:
        contacts.append(SelfCollision(system, collision_distance, restitution, friction))
    if ground_height is not None:
        contacts.append(Ground(restitution, friction, ground_height))
    return Simulator(system, forces, contacts)


def _calming(system: System, decay: TensorLike) -> BendingDamping:
    """Of the object as it lies at rest, with its mass spread evenly."""
    mass = system.value("mass").detach()
    whole = float(mass.mean()) * len(system.points)
    return BendingDamping.calming(
        system.points.double().cpu().numpy(), system.springs.cpu().numpy(), whole, decay
    )


def _indices(pairs: Tensor | np.ndarray | None) -> Tensor:
    if pairs is None:
        return torch.zeros((0, 2), dtype=torch.long)
    return (
        torch.as_tensor(np.asarray(pairs) if not isinstance(pairs, Tensor) else pairs).long().reshape(-1, 2)
    )
