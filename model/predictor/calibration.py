"""Spreads that mean what they say: one temperature per output, from cases that were not trained on."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.errors import InputError
from model.predictor.batches import Batch
from model.predictor.network import PredictorNetwork
from model.predictor.sample import GLOBALS, Prediction

SHARE, REACH = 0.9, 1.6448536269514722
"""The central interval that is set right, and how many standard deviations of a normal it reaches."""
LEAST = 20
"""Truths below which a temperature would be a guess."""
LIMITS = (0.2, 5.0)
"""No temperature is beyond."""


@dataclass(frozen=True)
class Deviations:
    """Of truths from what was predicted, in predicted standard deviations; NaN where no truth is known."""

    parts: Float[Tensor, " K"]
    globals: Float[Tensor, "B 4"]


@dataclass(frozen=True)
class Calibration:
    """What spreads had to be multiplied by."""

    parts: float = 1.0
    dashpot_damping: float = 1.0
    drag_rate: float = 1.0
    friction: float = 1.0
    restitution: float = 1.0
    looks: float = 0.0
    """Looks at cases that it rests on: those whose truth is known."""

    def as_dict(self) -> dict[str, float]:
        """By name."""
        return asdict(self)


def deviations(prediction: Prediction, batch: Batch) -> Deviations:
    """Of what is true from what was predicted."""
    truth = batch.truth
    return Deviations(
        (truth.part_log_modulus - prediction.part_log_modulus) / prediction.part_log_spread,
        (truth.globals - prediction.global_mean) / prediction.global_log_spread,
    )


def calibrate(network: PredictorNetwork, batches: Iterable[Batch]) -> Calibration:
    """Set the spreads of a network so that nine tenths of these truths lie within what should hold as many.

    One output at a time: what its spread is multiplied by is the 90 % quantile of the deviations over that of
    a normal. Springs follow their part.

    Args:
        network: Changed in place; its means stay.
        batches: Of cases that were not trained on, under the opinions that are to be expected.

    Raises:
        InputError: what it predicts is no number: nothing can be set right.

    Reference:
        Kuleshov, Fenner and Ermon (2018), Accurate uncertainties for deep learning using calibrated
        regression (recalibration on held-out data; here with one number per output).
    """
    network.eval()
    device = network.part_scale.device
    found, looks = list[Deviations](), 0
    with torch.no_grad():
        for batch in batches:
            here = batch.to(device)
            prediction = network(here.sample)
            if prediction.lost:
                lost = ", ".join(prediction.lost)
                raise InputError(
                    f"training diverged: what is predicted for {lost} is not finite: lower "
                    "model.learning_rate, or clip with trainer.gradient_clip_val"
                )
            found.append(deviations(prediction, here))
            looks += sum(case.truth is not None for case in batch.cases)
    if not found:
        return Calibration()
    values = torch.cat([each.globals for each in found])
    parts = _temperature(torch.cat([each.parts for each in found]))
    others = {name: _temperature(values[:, column]) for column, name in enumerate(GLOBALS)}
    network.calibrate(
        parts * float(network.part_scale),
        network.global_scale.cpu().numpy() * np.array(list(others.values()), np.float32),
    )
    return Calibration(parts=parts, looks=float(looks), **others)


def _temperature(found: Tensor) -> float:
    known = found[torch.isfinite(found)].abs().cpu().double().numpy()  # not every device has doubles
    if len(known) < LEAST:
        return 1.0
    return float(np.clip(np.quantile(known, SHARE) / REACH, *LIMITS))
