"""The ten materials, and what a belief about materials says about mechanics."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from model.errors import InputError
from model.priors.table import TABLE, Row
from model.types import Array, Estimate, ShapeClass
from model.units import PROPERTY_UNITS

MATERIALS = ("fabric", "leather", "rubber", "plastic", "metal", "wood", "paper", "silk", "denim", "fur")
_ROWS: Mapping[tuple[str, str], Row] = {(row.material, row.property): row for row in TABLE}


def typical(material: str, shape_class: ShapeClass) -> dict[str, Estimate]:
    """What one material is like in one shape: an estimate per property of `PROPERTY_UNITS`."""
    rows = {name: _ROWS[material, name] for name in PROPERTY_UNITS}
    return {
        name: Estimate(mean=row.value(shape_class), spread=row.spread, unit=PROPERTY_UNITS[name])
        for name, row in rows.items()
    }


def combine(distribution: Float64[Array, "10"], shape_class: ShapeClass) -> dict[str, Estimate]:
    """Properties of something that is one of the ten materials, with these probabilities."""
    each = [typical(material, shape_class) for material in MATERIALS]
    return {name: mixture([estimates[name] for estimates in each], distribution) for name in PROPERTY_UNITS}


def mixture(estimates: Sequence[Estimate], weights: Float64[Array, " n"]) -> Estimate:
    r"""The log-normal with the first two log-moments of a mixture of log-normals.

    $\mu = \sum_i w_i \mu_i$ and $\sigma^2 = \sum_i w_i (\sigma_i^2 + (\mu_i - \mu)^2)$ of the logarithms: the
    spread grows when the components disagree.

    Args:
        estimates: The components, all in one unit.
        weights: Their probabilities, which sum to 1.
    """
    means = np.log([estimate.mean for estimate in estimates])
    spreads = np.array([estimate.spread for estimate in estimates])
    mean = float(weights @ means)
    variance = float(weights @ (spreads**2 + (means - mean) ** 2))
    return Estimate(mean=float(np.exp(mean)), spread=float(np.sqrt(variance)), unit=estimates[0].unit)


def normalised(weights: Mapping[str, float]) -> Float64[Array, "10"]:
    """A distribution over `MATERIALS` from weights by name; absent materials get none.

    Raises:
        InputError: a weight is negative or not finite, or all are zero.
    """
    values = np.array([float(weights.get(material, 0.0)) for material in MATERIALS])
    if not np.isfinite(values).all() or (values < 0.0).any() or values.sum() <= 0.0:
        raise InputError("material weights must be finite, not negative and not all zero")
    distribution: Float64[Array, " m"] = values / values.sum()
    return distribution
