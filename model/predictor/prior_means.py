"""What the priors' means say of a topology, each quantity by itself and before any limit."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.types import Array, MaterialPrior, Topology

GRIP = 3.0
"""A controller spring over the springs of the point it holds, where the stability bound allows."""


def volumes(topology: Topology, priors: Sequence[MaterialPrior]) -> Float64[Array, " K"]:
    """Volume of each part [m³]: the mass of its points over its density."""
    mass = np.bincount(topology.part, topology.mass.astype(np.float64), minlength=len(priors))
    return np.asarray(mass / [prior.properties["density"].mean for prior in priors], np.float64)


def grip_stiffness(topology: Topology, stiffness: Float64[Array, " E"]) -> Float64[Array, " S"]:
    """Controller springs: `GRIP` × the springs of the point they hold, within the stability bound [N/m].

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


def dashpot_damping(topology: Topology, stiffness: Float64[Array, " E"], ratio: float) -> float:
    """2ζ√(k m), median over springs [N·s/m]."""
    mass = topology.mass.astype(np.float64)[topology.springs].mean(axis=1)
    return 2.0 * ratio * float(np.median(np.sqrt(stiffness * mass)))


def pooled(priors: Sequence[MaterialPrior], volume: Float64[Array, " K"], name: str) -> tuple[float, float]:
    """Volume-weighted geometric mean over the parts, and the spread of the logarithm."""
    share = volume / volume.sum()
    logs = np.log([prior.properties[name].mean for prior in priors])
    spreads = np.array([prior.properties[name].spread for prior in priors])
    mean = float(share @ logs)
    return float(np.exp(mean)), float(np.sqrt(share @ (spreads**2 + (logs - mean) ** 2)))


def collision_distance(topology: Topology) -> float:
    """Below every distance at rest, so that nothing collides with its own neighbours [m]."""
    gaps = cKDTree(topology.points).query(topology.points, 2)[0][:, 1]
    return float(min(0.8 * gaps.min(), 0.5 * np.median(gaps)))
