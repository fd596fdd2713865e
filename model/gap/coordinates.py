"""Quantities as the vector that a fit moves."""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float64

from model.gap.effects.base import Quantity
from model.types import Array


class Coordinates:
    """Quantities as a vector that a fit moves: logarithms over decades, else shares of the bounds."""

    def __init__(self, quantities: Mapping[str, Quantity]) -> None:
        """Of these quantities, in this order."""
        self.quantities = dict(quantities)
        self.names = tuple(quantities)

    def vector(self, values: Mapping[str, float]) -> Float64[Array, " d"]:
        """Coordinates of values, within the bounds."""
        inside = [np.clip(values[name], *self.quantities[name].bounds) for name in self.names]
        each = zip(inside, self.quantities.values(), strict=True)
        return np.array([np.log(x) if q.log else x / self._scale(q) for x, q in each], np.float64)

    def values(self, vector: Float64[Array, " d"]) -> dict[str, float]:
        """What a vector stands for."""
        each = zip(self.names, vector, self.quantities.values(), strict=True)
        return {name: float(np.exp(z) if q.log else z * self._scale(q)) for name, z, q in each}

    def tensors(self, vectors: Float64[Array, "b d"]) -> dict[str, torch.Tensor]:
        """Of shape [b, 1] each."""
        rows = [self.values(vector) for vector in vectors]
        return {name: torch.tensor([[row[name]] for row in rows], dtype=torch.float64) for name in self.names}

    @property
    def bounds(self) -> tuple[Float64[Array, " d"], Float64[Array, " d"]]:
        """Lower and upper."""
        low = self.vector({name: q.bounds[0] for name, q in self.quantities.items()})
        high = self.vector({name: q.bounds[1] for name, q in self.quantities.items()})
        return low, high

    @property
    def spreads(self) -> Float64[Array, " d"]:
        """Standard deviations of what is believed of each beforehand; NaN: nothing is."""
        each = ((q.spread, 1.0 if q.log else self._scale(q)) for q in self.quantities.values())
        return np.array([np.nan if spread is None else spread / unit for spread, unit in each], np.float64)

    @property
    def starts(self) -> Float64[Array, " d"]:
        """Where fits start, around which that is believed."""
        return self.vector({name: q.start for name, q in self.quantities.items()})

    @staticmethod
    def _scale(quantity: Quantity) -> float:
        low, high = quantity.bounds
        return 0.25 * (high - low)
