"""A prediction of one case → parameters that a twin carries and a simulator takes."""

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from model.formats.parameters import UNITS
from model.predictor.affordable import SUBSTEPS, affordable
from model.predictor.prior_means import collision_distance
from model.predictor.sample import GLOBALS, Prediction, Sample
from model.types import Array, Parameter, Parameters, Topology


def to_parameters(
    prediction: Prediction,
    sample: Sample,
    topology: Topology,
    gravity: tuple[float, float, float],
    ground_height: float | None,
) -> Parameters:
    """Take the means, limited to what explicit integration affords, and the spreads of the globals with them.

    Args:
        prediction: Of one case.
        sample: What it was predicted from.
        topology: What the sample was made from.
        gravity: [m/s²].
        ground_height: z of the ground [m]; None: no ground.
    """
    stiffness = np.exp(_numbers(prediction.log_modulus) + _numbers(sample.log_unit_stiffness))
    held = np.exp(_numbers(prediction.log_controller_stiffness))
    mean, spread = _numbers(prediction.global_mean)[0], _numbers(prediction.global_log_spread)[0]
    value, std = _natural(mean, spread)
    limit = affordable(topology, stiffness, held, float(value[0]))
    value[0], std[0] = value[0] * limit.dashpot, std[0] * limit.dashpot
    entries = {
        name: Parameter(float(one), UNITS[name], "predicted", float(apart))
        for name, one, apart in zip(GLOBALS, value, std, strict=True)
    }
    entries["collision_distance"] = Parameter(collision_distance(topology), "m", "prior")
    entries["gravity"] = Parameter(tuple(float(g) for g in gravity), "m/s^2", "prior")
    if ground_height is not None:
        entries["ground_height"] = Parameter(float(ground_height), "m", "prior")
    return Parameters(
        (stiffness * limit.stiffness).astype(np.float32),
        (held * limit.stiffness).astype(np.float32),
        entries,
        _warnings(_numbers(prediction.part_log_modulus), limit.stiffness),
    )


def _natural(
    mean: Float64[Array, "4"], spread: Float64[Array, "4"]
) -> tuple[Float64[Array, "4"], Float64[Array, "4"]]:
    """Values in their units and standard deviations, to first order, from the coordinates of `GLOBALS`."""
    value = np.exp(mean)
    value[3] = 1.0 / (1.0 + np.exp(-mean[3]))
    return value, spread * value * np.array([1.0, 1.0, 1.0, 1.0 - value[3]])


def _warnings(part_log_modulus: Float64[Array, " K"], scale: float) -> tuple[str, ...]:
    if scale >= 1.0:
        return ()
    softest, stiffest = np.exp([part_log_modulus.min(), part_log_modulus.max()])
    before, after = (f"{softest * one:.2g} to {stiffest * one:.2g} Pa" for one in (1.0, scale))
    return (f"stiffness limited from {before} to {after} so that {SUBSTEPS} substeps per frame suffice",)


def _numbers(values: Tensor) -> Float64[Array, "..."]:
    return np.asarray(values.detach().to("cpu", torch.float64).numpy(), np.float64)
