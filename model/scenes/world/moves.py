"""How hands move: ways and turns over time, drawn at random."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from model.types import Array


def ease(times: Float64[Array, " T"], begin: float, end: float) -> Float64[Array, " T"]:
    """From 0 to 1 between two moments with the least jerk."""
    share = np.clip((times - begin) / (end - begin), 0.0, 1.0)
    eased: Float64[Array, " T"] = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return eased


def rise(times: Float64[Array, " T"], height: float, rng: np.random.Generator) -> Float64[Array, "T 3"]:
    """Up and a little to one side, then partly down again."""
    begin, long = rng.uniform(0.05, 0.2), rng.uniform(0.6, 1.1)
    share = ease(times, begin, begin + long)
    back = rng.uniform(0.0, 0.25) * ease(times, begin + long + 0.1, begin + long + 0.7)
    up = np.outer(height * (share - back), [0.0, 0.0, 1.0])
    return np.asarray(up + np.outer(share * rng.uniform(0.0, 0.1), direction(rng)), np.float64)


def sway(times: Float64[Array, " T"], size: float, rng: np.random.Generator) -> Float64[Array, "T 3"]:
    """To and fro in the plane, growing out of rest."""
    rate, phase = rng.uniform(0.5, 1.3), rng.uniform(0.0, 0.3)
    swing = np.sin(2.0 * np.pi * rate * np.clip(times - phase, 0.0, None)) * ease(times, phase, phase + 0.8)
    return np.outer(size * rng.uniform(0.3, 1.0) * swing, direction(rng))


def turn(times: Float64[Array, " T"], most: float, rng: np.random.Generator) -> Float64[Array, "T 3"]:
    """Rotation vectors of a wrist that turns slowly."""
    axis = rng.normal(size=3)
    share = ease(times, rng.uniform(0.1, 0.4), rng.uniform(1.0, 1.6))
    return np.outer(rng.uniform(-most, most) * share, axis / np.linalg.norm(axis))


def upright(up: Float64[Array, " 3"]) -> Rotation:
    """The shortest turn that takes a direction to the vertical."""
    unit = up / max(float(np.linalg.norm(up)), 1e-9)
    axis = np.cross(unit, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-6:
        return Rotation.from_rotvec([0.0 if unit[2] > 0.0 else np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, unit[2]))


def direction(rng: np.random.Generator) -> Float64[Array, " 3"]:
    """A horizontal unit vector."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle), 0.0])
