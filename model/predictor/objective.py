"""The terms that training adds up: beliefs against truth and prior, motion against what was seen."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.predictor.batches import Batch
from model.predictor.checks import at_least
from model.predictor.losses import chamfer_loss, log_normal_divergence, surprise, track_loss
from model.predictor.rollout import Mechanics, mechanics_of, roll_out
from model.predictor.sample import Prediction
from model.scenes.case import Case
from model.scenes.room import LeftTheRoom, check_near
from model.simulator.divergence import SimulationDiverged
from model.types import Array

PRECISION = 0.03
"""Share of the size of an object at which errors of its motion begin to count linearly."""


@dataclass(frozen=True)
class LossWeights:
    """What the terms of the loss are multiplied by; 0 leaves one out.

    Attributes:
        track: Of the distance to where points were seen.
        chamfer: Of the distance of seen points to the nearest predicted one.
        prior: λ of the divergence of each part's belief from its prior.
        parts: Of how surprising the true modulus of each part is.
        springs: Of how surprising it is to its springs.
        globals: Of how surprising true dashpot, drag, friction and restitution are.
    """

    track: float = 1.0
    chamfer: float = 0.3
    prior: float = 1e-3
    parts: float = 1.0
    springs: float = 0.3
    globals: float = 0.3

    def __post_init__(self) -> None:
        """Refuse what would be maximised.

        Raises:
            InputError: see the message.
        """
        at_least(0, "model.weights", **asdict(self))

    def total(self, terms: Mapping[str, Tensor]) -> Float[Tensor, ""]:
        """The weighted sum of terms by the names above, where the first is: rollouts are on the processor."""
        device = next(iter(terms.values())).device
        return torch.stack([getattr(self, name) * value.to(device) for name, value in terms.items()]).sum()


def belief_terms(prediction: Prediction, batch: Batch) -> dict[str, Tensor]:
    """The terms that need no rollout: a few milliseconds for a case."""
    sample, truth = batch.sample, batch.truth
    divergence = log_normal_divergence(
        prediction.part_log_modulus,
        prediction.part_log_spread,
        sample.prior_log_modulus,
        sample.prior_log_spread,
    )
    return {
        "prior": divergence.mean(),
        "parts": surprise(prediction.part_log_modulus, prediction.part_log_spread, truth.part_log_modulus),
        "springs": surprise(prediction.log_modulus, prediction.log_modulus_spread, truth.log_modulus),
        "globals": surprise(prediction.global_mean, prediction.global_log_spread, truth.globals),
    }


def belief_counts(batch: Batch) -> dict[str, int]:
    """Of how many beliefs each of these terms is the mean, by name."""
    known = {
        "parts": batch.truth.part_log_modulus,
        "springs": batch.truth.log_modulus,
        "globals": batch.truth.globals,
    }
    counts = {name: int(torch.isfinite(truth).sum()) for name, truth in known.items()}
    return {"prior": batch.sample.prior_log_modulus.numel(), **counts}


def motion_terms(
    prediction: Prediction, batch: Batch, chosen: Sequence[int], horizon: int
) -> tuple[dict[str, Tensor], int]:
    """The terms of rollouts, means over cases; of their frames that may be learned from, no other counts.

    Args:
        prediction: Of the batch.
        batch: Cases of any sizes.
        chosen: Which of them are rolled out, by number.
        horizon: Frames, at most.

    Returns:
        Terms by name, none where nothing was rolled out; and how many rollouts diverged, which are left out.
    """
    each = mechanics_of(prediction, batch.sample, batch.cases)
    found, diverged = list[tuple[Tensor, Tensor]](), 0
    for number in chosen:
        try:
            found.append(_motion(batch.cases[number], each[number], horizon))
        except (SimulationDiverged, LeftTheRoom):
            diverged += 1
    if not found:
        return {}, diverged
    track, chamfer = (torch.stack(values).mean() for values in zip(*found, strict=True))
    return {"track": track, "chamfer": chamfer}, diverged


@dataclass(frozen=True)
class Judged:
    """How a held-out case moved, against what was seen and against how it really moved."""

    track: float
    chamfer: float
    """The terms of the loss, on the frames before the split."""
    past: float
    future: float
    """Mean distance of points over the object's size, in the frames before and from the split on."""
    diverged: bool = False
    """The rollout did; the figures are those of an object that does not move."""


def judge_motion(case: Case, mechanics: Mechanics) -> Judged:
    """Roll a case out through all of its frames; one that diverges is judged as if nothing had moved.

    Left out, it would make a predictor that diverges where motion is hard look better than one that does not.
    Distances are to where points really were, where that is known, else to where they were seen.
    """
    diverged = False
    try:
        with torch.no_grad():
            predicted = roll_out(case, mechanics, checkpoint=False)
        check_near(predicted.numpy(), case.rest)
    except (SimulationDiverged, LeftTheRoom):
        diverged = True
        predicted = torch.as_tensor(case.rest).expand(len(case.observation.times), -1, -1)
    known = case.observation.points if case.complete is None else case.complete
    distance = np.linalg.norm(predicted.numpy() - known, axis=-1) / object_size(case)
    track, chamfer = _compare(case, predicted[: case.split])
    return Judged(
        float(track),
        float(chamfer),
        _mean(distance[1 : case.split]),
        _mean(distance[case.split :]),
        diverged,
    )


def _motion(case: Case, mechanics: Mechanics, horizon: int) -> tuple[Tensor, Tensor]:
    predicted = roll_out(case, mechanics, min(case.split, horizon))
    check_near(predicted.detach().numpy(), case.rest)
    return _compare(case, predicted)


def _compare(case: Case, predicted: Float[Tensor, "T N 3"]) -> tuple[Tensor, Tensor]:
    """Track and Chamfer loss; frame 0 is given, not predicted."""
    seen = torch.as_tensor(case.observation.points[1 : len(predicted)])
    eye = None if case.camera is None else torch.as_tensor(case.camera.position, dtype=seen.dtype)
    scale = PRECISION * object_size(case)
    return track_loss(predicted[1:], seen, scale, eye), chamfer_loss(predicted[1:], seen, scale, eye)


def _mean(values: Float[Array, "..."]) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def object_size(case: Case) -> float:
    """Diameter about the centre of mass [m]."""
    points, mass = case.topology.points.astype(np.float64), case.topology.mass.astype(np.float64)
    return 2.0 * float(np.linalg.norm(points - np.average(points, 0, mass), axis=1).max())
