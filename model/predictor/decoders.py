"""Heads of the network: each reads tokens and answers how far from the prior a quantity is, and how surely.

Every answer starts near zero, so that an untrained network says what the prior says.
"""

from typing import ClassVar

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


class Decoder(nn.Module):
    """A head and what its answers mean, which subclasses say.

    Args:
        inputs: Length of what is read.
        dim: Of the hidden layers.
        dropout: Share of activations left out in training.
    """

    outputs: ClassVar[int]

    def __init__(self, inputs: int, dim: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.head = head(inputs, dim, self.outputs, dropout)


class PartDecoder(Decoder):
    """Where the modulus of a part lies, against its prior."""

    outputs = 2

    def forward(
        self, read: Float[Tensor, "K i"], prior_spread: Float[Tensor, " K"]
    ) -> tuple[Float[Tensor, " K"], Float[Tensor, " K"]]:
        """The difference to the prior's ln modulus, and the spread.

        Args:
            read: One row per part.
            prior_spread: Standard deviation of ln modulus by the prior.
        """
        shift, sureness = self.head(read).unbind(-1)
        return _against(prior_spread, shift, sureness, SPAN)


class EdgeDecoder(Decoder):
    """Where a spring lies within its part, from motion, material and geometry at once."""

    outputs = 2

    def forward(self, read: Float[Tensor, "E i"]) -> tuple[Float[Tensor, " E"], Float[Tensor, " E"]]:
        """The difference to the part's ln modulus, and a factor on the part's spread."""
        shift, sureness = self.head(read).unbind(-1)
        return soft_limit(shift, FIELD), soft_limit(sureness, LOCAL_SURENESS).exp()


class GripDecoder(Decoder):
    """How firmly a controller spring holds, against the rule for the springs at its point."""

    outputs = 1

    def forward(self, read: Float[Tensor, "S i"]) -> Float[Tensor, " S"]:
        """The difference in ln stiffness."""
        return soft_limit(self.head(read)[:, 0], GRIP)


class GlobalDecoder(Decoder):
    """Dashpot, drag, friction and restitution of a case, against its priors."""

    outputs = 8

    def forward(
        self, read: Float[Tensor, "B i"], prior_spread: Float[Tensor, "B 4"]
    ) -> tuple[Float[Tensor, "B 4"], Float[Tensor, "B 4"]]:
        """Differences to the prior's values in the coordinates of `GLOBALS`, and the spreads.

        Args:
            read: One row per case.
            prior_spread: Standard deviations by the prior.
        """
        shift, sureness = torch.chunk(self.head(read), 2, dim=-1)
        return _against(prior_spread, shift, sureness, GLOBAL_SPAN)


def _against(
    prior_spread: Float[Tensor, "*n"], shift: Float[Tensor, "*n"], sureness: Float[Tensor, "*n"], least: float
) -> tuple[Float[Tensor, "*n"], Float[Tensor, "*n"]]:
    """A difference to a prior of at most `WIDEST` spreads, or `least`, and a spread not far from its own."""
    limit = (WIDEST * prior_spread).clamp_min(least)
    return soft_limit(shift, limit), prior_spread * soft_limit(sureness, SURENESS).exp()
