"""A prediction → how its cases move, with gradients back to everything that was predicted."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from model.predictor.affordable import affordable
from model.predictor.sample import GLOBALS, Prediction, Sample
from model.scenes.case import Case
from model.scenes.replay import observed, roll, topology_simulator

STEEPEST = 1.0
"""Norm beyond which the gradient of one case, by all that was predicted of it, is cut."""


@dataclass(frozen=True)
class Mechanics:
    """What was predicted of one case, in the units of the simulator and on the graph of the prediction."""

    stiffness: Float[Tensor, " E"]
    """[N/m]."""
    controller_stiffness: Float[Tensor, " S"]
    """[N/m]."""
    dashpot_damping: Float[Tensor, ""]
    """[N·s/m]."""
    drag_rate: Float[Tensor, ""]
    """[1/s]."""
    friction: Float[Tensor, ""]
    restitution: Float[Tensor, ""]


def mechanics_of(prediction: Prediction, sample: Sample, cases: Sequence[Case]) -> list[Mechanics]:
    """Take the means of a prediction apart into its cases.

    Where a rollout is too steep (chaos after a contact, a case that nearly diverges), the gradient of this
    case alone is cut, so that it cannot drown the others of its batch: see `STEEPEST`.

    Args:
        prediction: Of the joined cases.
        sample: What it was predicted from.
        cases: In the order in which they were joined.
    """
    springs = [len(case.topology.springs) for case in cases]
    grips = [len(case.topology.controller_springs) for case in cases]
    log_stiffness = torch.split(sample.log_unit_stiffness + prediction.log_modulus, springs)
    log_held = torch.split(prediction.log_controller_stiffness, grips)
    return [_mechanics(*one) for one in zip(log_stiffness, log_held, prediction.global_mean, strict=True)]


def roll_out(
    case: Case, mechanics: Mechanics, frames: int | None = None, *, checkpoint: bool = True
) -> Float[Tensor, "T N 3"]:
    """Where the observed points are [m] in the first `frames` frames (None: all) under the case's controls.

    Stiffness and damping are scaled down to what explicit steps afford (`affordable`), as they are in a twin.

    Args:
        case: Topology, gravity, ground and controls.
        mechanics: What was predicted of it.
        frames: How far to go.
        checkpoint: Keep one state per frame for the backward pass and compute the substeps again there.

    Raises:
        SimulationDiverged: a state is not finite.
    """
    topology = case.topology
    limit = affordable(
        topology,
        mechanics.stiffness.detach().cpu().double().numpy(),
        mechanics.controller_stiffness.detach().cpu().double().numpy(),
        float(mechanics.dashpot_damping.detach()),
    )
    simulator = topology_simulator(
        topology,
        case.observation,
        stiffness=mechanics.stiffness * limit.stiffness,
        controller_stiffness=mechanics.controller_stiffness * limit.stiffness,
        dashpot_damping=mechanics.dashpot_damping * limit.dashpot,
        drag_rate=mechanics.drag_rate,
        friction=mechanics.friction,
        restitution=mechanics.restitution,
    )
    return observed(case.anchors, roll(case, simulator, frames, checkpoint=checkpoint))


def _mechanics(log_stiffness: Tensor, log_held: Tensor, values: Tensor) -> Mechanics:
    # the simulator computes where its arrays are: on the processor
    coordinates = torch.cat([log_stiffness, log_held, values]).cpu()
    if coordinates.requires_grad:
        coordinates.register_hook(_cut)  # type: ignore[no-untyped-call]
    springs, held, rest = torch.split(coordinates, [len(log_stiffness), len(log_held), len(values)])
    logs = dict(zip(GLOBALS, rest, strict=True))
    return Mechanics(
        stiffness=springs.exp(),
        controller_stiffness=held.exp(),
        dashpot_damping=logs["dashpot_damping"].exp(),
        drag_rate=logs["drag_rate"].exp(),
        friction=logs["friction"].exp(),
        restitution=logs["restitution"].sigmoid(),
    )


def _cut(gradient: Tensor) -> Tensor:
    """A gradient of at most the norm STEEPEST; none where it is not finite."""
    if not bool(torch.isfinite(gradient).all()):
        return torch.zeros_like(gradient)
    return gradient * min(1.0, STEEPEST / max(float(gradient.norm()), 1e-12))
