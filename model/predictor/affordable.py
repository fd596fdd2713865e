"""What explicit integration affords: softer or less damped where a twin would need too many substeps."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from model.predictor.stability import fastest, stable_step
from model.types import Array, Topology

SUBSTEPS = 250
"""Substeps per frame of 1/30 s that a twin may cost."""
MARGIN = 1.2
"""Of the stability bound, as the simulator takes it."""
DAMPING_LIMIT = 1.5
"""Largest λ(M⁻¹C)/√λ(M⁻¹K): beyond, damping alone would more than halve the stable step."""


@dataclass(frozen=True)
class Affordable:
    """By what to multiply so that `SUBSTEPS` suffice; 1 and 1: nothing is limited."""

    stiffness: float
    """Of springs and controller springs."""
    dashpot: float


def affordable(
    topology: Topology, stiffness: Float[Array, " E"], held: Float[Array, " S"], dashpot: float
) -> Affordable:
    """Limit damping to what the stiffness affords, then both to `SUBSTEPS`.

    Args:
        topology: Masses and directions of the springs.
        stiffness: Of the springs [N/m].
        held: Of the controller springs [N/m].
        dashpot: Of every spring [N·s/m].
    """
    frequency_squared = fastest(topology, stiffness, held)
    decay = dashpot * fastest(topology, np.ones(len(stiffness)), np.ones(len(held)))
    calm = min(1.0, DAMPING_LIMIT * float(np.sqrt(frequency_squared)) / max(decay, 1e-12))
    substeps = MARGIN / (30.0 * stable_step(frequency_squared, calm * decay))
    # the stable step goes as 1/√stiffness, the dashpot as √stiffness: one scaling settles it
    slower = min(1.0, SUBSTEPS / substeps)
    return Affordable(stiffness=slower**2, dashpot=calm * slower)
