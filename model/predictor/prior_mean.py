"""Parameters before anything was learned: what the material prior means on this topology."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.predictor.base import ParameterPredictor
from model.predictor.lattice import lattice_stiffness
from model.predictor.stability import fastest, stable_step
from model.types import (
    Array,
    Calibration,
    Frames,
    Masks,
    MaterialPrior,
    Parameter,
    Parameters,
    ShapeClass,
    Topology,
    Tracks,
)

SUBSTEPS = 250
"""Substeps per frame of 1/30 s that a twin may cost; stiffer priors are limited to it."""
MARGIN = 1.2
"""Of the stability bound, as the simulator takes it."""
DAMPING_LIMIT = 1.5
"""Largest λ(M⁻¹C)/√λ(M⁻¹K): beyond, damping alone would more than halve the stable step."""
GRIP = 3.0
"""A controller spring over the springs of the point it holds, where the stability bound allows."""

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

    def __call__(
        self,
        topology: Topology,
        priors: Sequence[MaterialPrior],
        shape_class: ShapeClass,
        calibration: Calibration,
        frames: Frames,
        masks: Masks,
        tracks: Tracks,
    ) -> Parameters:
        """Parametrise the topology; frames, masks and tracks are not looked at."""
        return self.from_priors(topology, priors, shape_class, calibration.gravity, calibration.ground_height)

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
        volume = _volumes(topology, priors)
        modulus = np.array([prior.properties["stiffness"].mean for prior in priors])
        stiffness = lattice_stiffness(topology, modulus, volume, shape_class)
        held = _grip_stiffness(topology, stiffness)
        damping, damping_spread = _pooled(priors, volume, "damping")
        frequency_squared = fastest(topology, stiffness, held)
        dashpot = _dashpot(topology, stiffness, damping, frequency_squared)
        step = stable_step(frequency_squared, _decay(topology, dashpot))
        warnings: tuple[str, ...] = ()
        substeps = MARGIN / (30.0 * step)
        if substeps > SUBSTEPS:
            # the stable step goes as 1/√stiffness, the dashpot as √stiffness: one scaling settles it
            scale = (SUBSTEPS / substeps) ** 2
            stiffness, held, dashpot = stiffness * scale, held * scale, dashpot * scale**0.5
            warnings = (_limited(priors, scale),)
        entries = {
            "dashpot_damping": Parameter(dashpot, "N*s/m", "prior", dashpot * damping_spread),
            "collision_distance": Parameter(_collision_distance(topology), "m", "prior"),
            "gravity": Parameter(tuple(float(g) for g in gravity), "m/s^2", "prior"),
        }
        for name, unit in POOLED.items():
            value, spread = _pooled(priors, volume, name)
            entries[name] = Parameter(value, unit, "prior", value * spread)
        if ground_height is not None:
            entries["ground_height"] = Parameter(float(ground_height), "m", "prior")
        return Parameters(stiffness.astype(np.float32), held.astype(np.float32), entries, warnings)


def _volumes(topology: Topology, priors: Sequence[MaterialPrior]) -> Float64[Array, " K"]:
    """Volume of each part [m³]: the mass of its points over its density."""
    mass = np.bincount(topology.part, topology.mass.astype(np.float64), minlength=len(priors))
    return np.asarray(mass / [prior.properties["density"].mean for prior in priors], np.float64)


def _grip_stiffness(topology: Topology, stiffness: Float64[Array, " E"]) -> Float64[Array, " S"]:
    """Controller springs: `GRIP` × the springs of the point they hold, within the stability bound.

    2 Σk/m over the springs of a point bounds the modes there; the grip may fill a point up to the
    largest such value of the object, so that a firm hand does not make the whole twin slower, but
    no controller spring gets softer than the springs it holds.
    """
    count = len(topology.points)
    ends = topology.springs
    total = sum(np.bincount(ends[:, side], stiffness, minlength=count) for side in (0, 1))
    degree = sum(np.bincount(ends[:, side], minlength=count) for side in (0, 1))
    usual = total / np.maximum(degree, 1)
    held = topology.controller_springs[:, 1]
    grips = np.bincount(held, minlength=count)
    room = (2.0 * total / topology.mass).max(initial=0.0) * topology.mass - 2.0 * total
    firm = np.clip(room / np.maximum(grips, 1), usual, GRIP * usual)
    return np.asarray(firm[held], np.float64)


def _dashpot(
    topology: Topology, stiffness: Float64[Array, " E"], ratio: float, frequency_squared: float
) -> float:
    """2ζ√(k m), median over springs [N·s/m]; limited where it would rule the step size."""
    mass = topology.mass.astype(np.float64)[topology.springs].mean(axis=1)
    dashpot = 2.0 * ratio * float(np.median(np.sqrt(stiffness * mass)))
    share = _decay(topology, dashpot) / np.sqrt(frequency_squared)
    return float(dashpot * min(1.0, DAMPING_LIMIT / max(share, 1e-12)))


def _decay(topology: Topology, dashpot: float) -> float:
    """Fastest decay rate under a uniform dashpot [1/s]."""
    springs, grips = len(topology.springs), len(topology.controller_springs)
    return dashpot * fastest(topology, np.ones(springs), np.ones(grips))


def _pooled(priors: Sequence[MaterialPrior], volume: Float64[Array, " K"], name: str) -> tuple[float, float]:
    """Volume-weighted geometric mean over the parts, and the spread of the logarithm."""
    share = volume / volume.sum()
    logs = np.log([prior.properties[name].mean for prior in priors])
    spreads = np.array([prior.properties[name].spread for prior in priors])
    mean = float(share @ logs)
    return float(np.exp(mean)), float(np.sqrt(share @ (spreads**2 + (logs - mean) ** 2)))


def _collision_distance(topology: Topology) -> float:
    """Below every distance at rest, so that nothing collides with its own neighbours [m]."""
    gaps = cKDTree(topology.points).query(topology.points, 2)[0][:, 1]
    return float(min(0.8 * gaps.min(), 0.5 * np.median(gaps)))


def _limited(priors: Sequence[MaterialPrior], scale: float) -> str:
    moduli = sorted({prior.properties["stiffness"].mean for prior in priors})
    before = " to ".join(f"{modulus:.2g}" for modulus in {moduli[0]: 0, moduli[-1]: 0})
    after = " to ".join(f"{modulus * scale:.2g}" for modulus in {moduli[0]: 0, moduli[-1]: 0})
    return f"stiffness limited from {before} Pa to {after} Pa so that {SUBSTEPS} substeps per frame suffice"
