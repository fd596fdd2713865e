"""Soft limits: outputs stay in range, gradients stay alive."""

from torch import Tensor


def soft_limit(value: Tensor, limit: Tensor | float) -> Tensor:
    r"""$x / (1 + |x| / L)$: the identity near 0, never beyond ±L.

    Its slope $1/(1+|x|/L)^2$ falls off as a power, where that of a clamp is 0 and those of a logistic or a
    tanh die exponentially: what has run to the limit still finds back.

    Args:
        value: Any shape.
        limit: L > 0, of a shape that fits.
    """
    return value / (1.0 + value.abs() / limit)
