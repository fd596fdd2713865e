"""What material priors say, as numbers of order one."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Float64

from model.types import Array, MaterialPrior

_USUAL = {
    "stiffness": (3e4, 3.0),
    "density": (200.0, 1.0),
    "damping": (0.1, 1.0),
    "drag_rate": (0.5, 1.0),
    "friction": (0.5, 0.5),
    "restitution": (0.15, 1.0),
}
"""Of every property: a middling value, and how far ln values lie apart."""
BELIEFS = len(_USUAL) + 3
"""Columns of `describe_beliefs`."""
WEIGHTLESS = 0.1
"""Gravity [m/s²] below which a body's own weight is not what it is compared with."""


def describe_beliefs(
    priors: Sequence[MaterialPrior], size: float, gravity: tuple[float, float, float]
) -> Float32[Array, "K Fb"]:
    """Per part: every property's mean, how sure the prior is, and the modulus over the body's own weight.

    Args:
        priors: One per part.
        size: Of the object [m].
        gravity: [m/s²].
    """
    means = log_means(priors, tuple(_USUAL))
    middle = np.array([np.log(value) for value, _ in _USUAL.values()])
    apart = np.array([scale for _, scale in _USUAL.values()])
    spread = np.array([prior.properties["stiffness"].spread for prior in priors])
    chance = np.array([np.maximum(prior.distribution, 1e-12) for prior in priors])
    entropy = -(chance * np.log(chance)).sum(axis=1)
    strength = max(float(np.linalg.norm(gravity)), WEIGHTLESS)
    sturdiness = means[:, 0] - means[:, 1] - np.log(strength * size)
    columns = [
        (means - middle) / apart,
        np.stack([spread - 1.0, entropy - 1.0, sturdiness / 3.0 - 1.0], axis=1),
    ]
    return np.concatenate(columns, axis=1).astype(np.float32)


def log_means(priors: Sequence[MaterialPrior], names: Sequence[str]) -> Float64[Array, "K m"]:
    """Logarithms of the means of these properties, each in its unit."""
    return np.log([[prior.properties[name].mean for name in names] for prior in priors])
