"""Heads of the network: each reads tokens and answers how far from the prior a quantity is, and how surely.

Every answer starts near zero, so that an untrained network says what the prior says.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from model.predictor.layers import head
from model.predictor.limits import soft_limit

WIDEST = 4.0
"""Spreads of the prior by which a quantity may differ from its mean at most."""
SPAN = 8.0
"""The least such limit of a modulus [ln]: a prior may be sure of the wrong one of the ten materials, whose
moduli span a factor of 2500 (ln: 7.8)."""
GLOBAL_SPAN = 1.5
"""The least such limit of a global parameter."""
FIELD = 0.75
"""How far a spring may differ from its part at most [ln]: parts are chosen to be of one material."""
GRIP = 1.5
"""How far a controller spring may differ from the prior's rule at most [ln]."""
SURENESS = 3.0
"""How much surer or less sure than the prior an answer may be at most [ln]."""
LOCAL_SURENESS = 1.5
"""The same of a spring against its parts."""


class PartDecoder(nn.Module):
    """Where the modulus of a part lies, against its prior.

    Args:
        inputs: Length of what is read.
        dim: Of the hidden layers.
        dropout: Share of activations left out in training.
    """

    def __init__(self, inputs: int, dim: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.head = head(inputs, dim, 2, dropout)

    def forward(
        self, read: Float[Tensor, "K i"], prior_spread: Float[Tensor, " K"]
    ) -> tuple[Float[Tensor, " K"], Float[Tensor, " K"]]:
        """The difference to the prior's ln modulus, and the spread.

        Args:
            read: One row per part.
            prior_spread: Standard deviation of ln modulus by the prior.
        """
        shift, sureness = self.head(read).unbind(-1)
        limit = (WIDEST * prior_spread).clamp_min(SPAN)
        return soft_limit(shift, limit), prior_spread * soft_limit(sureness, SURENESS).exp()


class EdgeDecoder(nn.Module):
    """Where a spring lies within its part, from motion, material and geometry at once.

    Args:
        inputs: Length of what is read.
        dim: Of the hidden layers.
        dropout: Share of activations left out in training.
    """

    def __init__(self, inputs: int, dim: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.head = head(inputs, dim, 2, dropout)

    def forward(self, read: Float[Tensor, "E i"]) -> tuple[Float[Tensor, " E"], Float[Tensor, " E"]]:
        """The difference to the part's ln modulus, and a factor on the part's spread."""
        shift, sureness = self.head(read).unbind(-1)
        return soft_limit(shift, FIELD), soft_limit(sureness, LOCAL_SURENESS).exp()


class GripDecoder(nn.Module):
    """How firmly a controller spring holds, against the rule for the springs at its point.

    Args:
        inputs: Length of what is read.
        dim: Of the hidden layers.
        dropout: Share of activations left out in training.
    """

    def __init__(self, inputs: int, dim: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.head = head(inputs, dim, 1, dropout)

    def forward(self, read: Float[Tensor, "S i"]) -> Float[Tensor, " S"]:
        """The difference in ln stiffness."""
        return soft_limit(self.head(read)[:, 0], GRIP)


class GlobalDecoder(nn.Module):
    """Dashpot, drag, friction and restitution of a case, against its priors.

    Args:
        inputs: Length of what is read.
        dim: Of the hidden layers.
        dropout: Share of activations left out in training.
    """

    def __init__(self, inputs: int, dim: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.head = head(inputs, dim, 8, dropout)

    def forward(
        self, read: Float[Tensor, "B i"], prior_spread: Float[Tensor, "B 4"]
    ) -> tuple[Float[Tensor, "B 4"], Float[Tensor, "B 4"]]:
        """Differences to the prior's values in the coordinates of `GLOBALS`, and the spreads.

        Args:
            read: One row per case.
            prior_spread: Standard deviations by the prior.
        """
        shift, sureness = torch.chunk(self.head(read), 2, dim=-1)
        limit = (WIDEST * prior_spread).clamp_min(GLOBAL_SPAN)
        return soft_limit(shift, limit), prior_spread * soft_limit(sureness, SURENESS).exp()
