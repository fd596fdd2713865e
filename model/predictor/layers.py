"""Small layers that the network is put together from."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from model.predictor.limits import soft_limit

_OUTLIER = 6.0
"""Standard deviations beyond which an input is not told from one farther out."""
_QUIET = 0.01
"""How much smaller than usual the last weights of a head start: an untrained network says what the prior
says, and its gradients are small but not zero."""


class Standardise(nn.Module):
    """Inputs over their spread in the training set; before `fit`, as they come. Outliers are drawn in.

    Args:
        dim: How many inputs.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, dim: int) -> None:
        """The identity, but for outliers."""
        super().__init__()
        self.register_buffer("mean", torch.zeros(dim))
        self.register_buffer("scale", torch.ones(dim))

    def fit(self, values: Float[Tensor, "n d"]) -> None:
        """Take mean and spread from these rows; a column that does not vary keeps its scale."""
        self.mean.copy_(values.mean(dim=0))
        spread = values.std(dim=0, correction=0)
        self.scale.copy_(torch.where(spread > 1e-3, spread, torch.ones_like(spread)))

    def forward(self, values: Float[Tensor, "*n d"]) -> Float[Tensor, "*n d"]:
        """Of order one."""
        return soft_limit((values - self.mean) / self.scale, _OUTLIER)


def perceptron(inputs: int, outputs: int, dropout: float) -> nn.Sequential:
    """Two layers; what comes out is normalised."""
    return nn.Sequential(
        nn.Linear(inputs, outputs),
        nn.GELU(),
        nn.Dropout(dropout),
        nn.Linear(outputs, outputs),
        nn.LayerNorm(outputs),
    )


def head(inputs: int, hidden: int, outputs: int, dropout: float) -> nn.Sequential:
    """Two hidden layers; what comes out is a small number at first."""
    last = nn.Linear(hidden, outputs)
    with torch.no_grad():
        last.weight.mul_(_QUIET)
        last.bias.zero_()
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.GELU(), nn.Dropout(dropout), nn.Linear(hidden, hidden), nn.GELU(), last
    )


def mean_by(values: Float[Tensor, "n ..."], group: Int64[Tensor, " n"], count: int) -> Float[Tensor, "m ..."]:
    """Mean of the rows of each group; zeros for a group without rows."""
    total = values.new_zeros(count, *values.shape[1:]).index_add(0, group, values)
    rows = values.new_zeros(count).index_add(0, group, values.new_ones(len(group)))
    return total / rows.clamp_min(1.0).reshape(-1, *[1] * (values.ndim - 1))
