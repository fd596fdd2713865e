"""How large an object is."""

import numpy as np
from jaxtyping import Float64

from model.types import Array


def size_of(places: Float64[Array, "N 3"]) -> float:
    """Twice the way from its middle to its farthest point [m], which no turn changes."""
    return 2.0 * float(np.linalg.norm(places - places.mean(0), axis=1).max())
