"""Parameters before anything was learned: what the material prior means on this topology."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.predictor.base import ParameterPredictor
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

LATTICE = {"solid": 6.0, "rope": 6.0, "sheet": 3.0}
"""Σ k L² over (volume × Young's modulus) of an isotropic network of central springs."""
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
    r"""Each part gets its prior's mean modulus, the object its prior's mean global parameters.

    A network of central springs without preferred direction that deforms affinely has the energy density
    $\frac{1}{2V}\sum k L^2 (n\cdot\varepsilon n)^2$; averaging over directions gives Lamé constants
    $\lambda=\mu=\frac{1}{15V}\sum kL^2$ in space and $\frac{1}{8A}\sum kL^2$ in a plane, hence

    $E = \frac{1}{6V}\sum kL^2$ (solid) and $E h = \frac{1}{3A}\sum kL^2$ (sheet of thickness h).

    A rope here has several points per section, so it is a slender solid: $E A_c$ over its length is the
    same sum. (Springs all along the axis would have $E A_c=\sum kL^2/\mathrm{length}$.) With V the part's
    mass over its density and k = Y/L, the part's Y follows; springs across a border take the mean Y of
    their two parts.

    The dashpot has the prior's damping ratio ζ at the scale of a spring, $2\zeta\sqrt{km}$ (median).
    Modes slower than that are damped less by it; drag acts on them. Where the explicit integration
    would need more than `SUBSTEPS`, all stiffness is scaled down and a warning says so.

    Reference:
        Hrennikoff (1941), Solution of problems of elasticity by the framework method (Poisson's ratio
        1/4 in space, 1/3 in a plane); Kot, Nagahashi and Szymczak (2015), Elastic moduli of simple
        mass spring models; Jiang et al. (2025), PhysTwin (k = Y/L).
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
        volume = _volumes(topology, priors)
        stiffness = _lattice_stiffness(topology, priors, volume, shape_class)
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
            "gravity": Parameter(tuple(float(g) for g in calibration.gravity), "m/s^2", "prior"),
        }
        for name, unit in POOLED.items():
            value, spread = _pooled(priors, volume, name)
            entries[name] = Parameter(value, unit, "prior", value * spread)
        if calibration.ground_height is not None:
            entries["ground_height"] = Parameter(float(calibration.ground_height), "m", "prior")
        return Parameters(stiffness.astype(np.float32), held.astype(np.float32), entries, warnings)


def _volumes(topology: Topology, priors: Sequence[MaterialPrior]) -> Float64[Array, " K"]:
    """Volume of each part [m³]: the mass of its points over its density."""
    mass = np.bincount(topology.part, topology.mass.astype(np.float64), minlength=len(priors))
    return np.asarray(mass / [prior.properties["density"].mean for prior in priors], np.float64)


def _lattice_stiffness(
    topology: Topology,
    priors: Sequence[MaterialPrior],
    volume: Float64[Array, " K"],
    shape_class: ShapeClass,
) -> Float64[Array, " E"]:
    """Stiffness k = Y/L with each part's Y such that its network has the prior's modulus [N/m]."""
    length = topology.rest_length.astype(np.float64)
    ends = topology.part[topology.springs]
    # half of every spring belongs to each of its ends, so half of a border spring to each part
    total = sum(np.bincount(ends[:, side], 0.5 * length, minlength=len(priors)) for side in (0, 1))
    modulus = np.array([prior.properties["stiffness"].mean for prior in priors])
    per_strain = LATTICE[shape_class] * modulus * volume / np.where(total > 0, total, np.inf)
    return np.asarray(per_strain[ends].mean(axis=1) / length, np.float64)


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
