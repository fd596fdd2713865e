"""How well a fit knows what it found."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from model.simulator.fitting.gauss_newton import differences
from model.simulator.fitting.minimise import Vector
from model.simulator.fitting.objective import Look, Objective

ROUNDED = 1e-14
"""Share of the best known direction's curvature below which there is nothing but rounding."""
SMALLEST = 1e-150
"""The least curvature there is, where nothing is known of any direction: spreads have to be numbers."""


@dataclass(frozen=True)
class Covariance:
    """Of the free values of a fit, near where it ended."""

    names: tuple[str, ...]
    """What each row belongs to."""
    matrix: Float64[np.ndarray, "n n"]
    """On the scale of the search: of logarithms for parameters above zero."""
    spread: Mapping[str, Tensor]
    """Standard deviation of each free value, in its unit."""

    @property
    def correlation(self) -> Float64[np.ndarray, "n n"]:
        """Of the free values with each other."""
        root = np.sqrt(np.diag(self.matrix))
        correlation: Float64[np.ndarray, "n n"] = self.matrix / np.outer(root, root)
        return correlation


def covariance(objective: Objective, z: Vector, look: Look) -> Covariance:
    r"""By Gauss and Newton: $s^2 (J^\top J)^{-1}$, J by central differences, two rollouts per free value.

    $s^2$ is the mean square residual, or 1 where the residuals are smaller than the noise they are measured
    in. Residuals count as independent of each other; where they are not, spreads are too small. Directions
    that nothing in the observation holds have a very large spread.

    Reference:
        Nocedal and Wright (2006), Numerical optimization, section 10.3 (Gauss-Newton).
    """
    residual = objective.residuals(z, look)
    low, high = objective.limits
    assert residual is not None, "a fit does not end where nothing is finite"
    jacobian = differences(lambda place: objective.residuals(place, look), z, low, high, len(residual))
    freedom = max(1, objective.count(look) - len(z))
    scale = max(1.0, float(residual @ residual) / freedom)
    held, directions = np.linalg.eigh(jacobian.T @ jacobian)
    # what is not held at all is held less than rounding can say, not exactly known
    held = held.clip(max(ROUNDED * float(held.max()), SMALLEST))
    matrix = scale * (directions / held) @ directions.T
    matrix = (matrix + matrix.T) / 2
    return Covariance(tuple(objective.names()), matrix, _spread(objective, z, matrix))


def _spread(objective: Objective, z: Vector, matrix: Float64[np.ndarray, "n n"]) -> dict[str, Tensor]:
    """Of values, from that of coordinates."""
    deviations = objective.split(torch.from_numpy(np.sqrt(np.diag(matrix).clip(0.0))))
    made = {}
    for unknown, part, deviation in zip(
        objective.unknowns, objective.split(torch.from_numpy(z.copy())), deviations, strict=True
    ):
        slope = unknown.scale if unknown.soft is None else part.exp()
        made[unknown.name] = deviation * slope
    return made
