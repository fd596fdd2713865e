"""What each of the ten materials means to the network, beyond the numbers of the prior."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from model.priors.materials import MATERIALS


class Codebook(nn.Module):
    """One learned embedding per material; a belief over materials is embedded as their mean under it.

    Args:
        dim: Length of an embedding.
    """

    def __init__(self, dim: int) -> None:
        """Draw the embeddings."""
        super().__init__()
        self.embeddings = nn.Parameter(torch.randn(len(MATERIALS), dim) / dim**0.5)

    def forward(self, distribution: Float[Tensor, "K M"]) -> Float[Tensor, "K C"]:
        """Embed one belief per part."""
        return distribution @ self.embeddings


class WithoutCodebook(nn.Module):
    """Ablation: materials have no embedding; only the numbers of the prior tell parts apart.

    Args:
        dim: Length of the zeros that stand in for an embedding.
    """

    def __init__(self, dim: int) -> None:
        """Nothing to learn."""
        super().__init__()
        self.dim = dim

    def forward(self, distribution: Float[Tensor, "K M"]) -> Float[Tensor, "K C"]:
        """Zeros."""
        return distribution.new_zeros(len(distribution), self.dim)
