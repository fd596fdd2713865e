"""Parameters before anything was learned: what the material prior means on this topology."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from model.predictor.affordable import DAMPING_LIMIT, MARGIN, SUBSTEPS, affordable
from model.predictor.base import ParameterPredictor
from model.predictor.lattice import lattice_stiffness
from model.predictor.prior_means import (
    GRIP,
    collision_distance,
    dashpot_damping,
    grip_stiffness,
    pooled,
    volumes,
)
from model.scenes.case import Case
from model.types import Array, MaterialPrior, Parameter, Parameters, ShapeClass, Topology

__all__ = ["DAMPING_LIMIT", "GRIP", "MARGIN", "POOLED", "SUBSTEPS", "PriorMeanPredictor"]

POOLED = {"drag_rate": "1/s", "friction": "1", "restitution": "1"}
"""Global parameters that are the parts' volume-weighted means, and their units."""


class PriorMeanPredictor(ParameterPredictor):
    """Each part gets its prior's mean modulus, the object its prior's mean global parameters.

    The springs of a part share its modulus as `model.predictor.lattice` says, with the part's volume its mass
    over its density.

    The dashpot has the prior's damping ratio ζ at the scale of a spring, 2ζ√(km) (median).
    Modes slower than that are damped less by it; drag acts on them. Where the explicit integration
    would need more than `SUBSTEPS`, all stiffness is scaled down and a warning says so.

    Reference:
        Jiang et al. (2025), PhysTwin (springs with dashpots along their axes, drag, k = Y/L).
    """

    name = "prior-mean"
    version = "1"
    weights: str | None = None

    def __call__(self, case: Case, images: UInt8[Array, "T H W 3"] | None = None) -> Parameters:
        """Parametrise the topology; how it moved is not looked at."""
        seen = case.observation
        return self.from_priors(
            case.topology, case.priors, case.shape_class, seen.gravity, seen.ground_height
        )

    def from_priors(
        self,
        topology: Topology,
        priors: Sequence[MaterialPrior],
        shape_class: ShapeClass,
        gravity: tuple[float, float, float],
        ground_height: float | None,
    ) -> Parameters:
        """Parametrise a topology of which nothing else is known.

        Args:
            topology: What to parametrise.
            priors: One per part, in the order of the labels.
            shape_class: Sheet, rope or solid: how springs share the modulus.
            gravity: [m/s²].
            ground_height: z of the ground [m]; None: no ground.
        """
        volume = volumes(topology, priors)
        modulus = np.array([prior.properties["stiffness"].mean for prior in priors])
        stiffness = lattice_stiffness(topology, modulus, volume, shape_class)
        held = grip_stiffness(topology, stiffness)
        damping, damping_spread = pooled(priors, volume, "damping")
        dashpot = dashpot_damping(topology, stiffness, damping)
        limit = affordable(topology, stiffness, held, dashpot)
        stiffness, held, dashpot = (
            stiffness * limit.stiffness,
            held * limit.stiffness,
            dashpot * limit.dashpot,
        )
        warnings = (_limited(priors, limit.stiffness),) if limit.stiffness < 1.0 else ()
        entries = {
            "dashpot_damping": Parameter(dashpot, "N*s/m", "prior", dashpot * damping_spread),
            "collision_distance": Parameter(collision_distance(topology), "m", "prior"),
            "gravity": Parameter(tuple(float(g) for g in gravity), "m/s^2", "prior"),
        }
        for name, unit in POOLED.items():
            value, spread = pooled(priors, volume, name)
            entries[name] = Parameter(value, unit, "prior", value * spread)
        if ground_height is not None:
            entries["ground_height"] = Parameter(float(ground_height), "m", "prior")
        return Parameters(stiffness.astype(np.float32), held.astype(np.float32), entries, warnings)


def _limited(priors: Sequence[MaterialPrior], scale: float) -> str:
    moduli = sorted({prior.properties["stiffness"].mean for prior in priors})
    before = " to ".join(f"{modulus:.2g}" for modulus in {moduli[0]: 0, moduli[-1]: 0})
    after = " to ".join(f"{modulus * scale:.2g}" for modulus in {moduli[0]: 0, moduli[-1]: 0})
    return f"stiffness limited from {before} Pa to {after} Pa so that {SUBSTEPS} substeps per frame suffice"
