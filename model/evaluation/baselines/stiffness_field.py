"""Stiffness as a function of where a spring is at rest: planes of features, and a small network."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

AXES = ((0, 1), (0, 2), (1, 2))
"""The coordinates that each plane spans."""


class StiffnessField(nn.Module):
    """ln of a factor at each place, zero everywhere before it has learned.

    A place is looked up on three planes of features through its body, bilinearly; the features, added up,
    and the place itself go through a small network.

    Args:
        low: Least value that is returned, below 0.
        high: Largest, above 0; both are approached but never reached, and slopes never vanish.
        resolution: Cells along a plane.
        channels: Features of a cell.
        width: Of the network's two layers.
        seed: Of its random start.

    Reference:
        Chan et al. (2022), Efficient geometry-aware 3D generative adversarial networks, CVPR (tri-planes);
        Xu et al. (2025), NeuSpring: Neural spring fields for reconstruction and simulation of deformable
        objects from videos, arXiv:2511.08310 (springs as a field over the canonical shape).
    """

    def __init__(
        self,
        low: float,
        high: float,
        *,
        resolution: int = 16,
        channels: int = 8,
        width: int = 64,
        seed: int = 0,
    ) -> None:
        """See the class."""
        super().__init__()
        random = torch.Generator().manual_seed(seed)
        self._low, self._high = low, high
        self.planes = nn.Parameter(
            0.1 * torch.randn(len(AXES), channels, resolution, resolution, generator=random)
        )
        self.layers = nn.Sequential(
            nn.Linear(channels + 3, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU(), nn.Linear(width, 1)
        )
        for layer in self.layers:
            if isinstance(layer, nn.Linear):
                bound = layer.in_features**-0.5
                nn.init.uniform_(layer.weight, -bound, bound, generator=random)
                nn.init.zeros_(layer.bias)
        last = self.layers[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)

    def forward(self, places: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        """Of places in the cube from -1 to 1."""
        grids = torch.stack([places[:, list(axes)] for axes in AXES]).unsqueeze(2)
        features = nn.functional.grid_sample(self.planes, grids, align_corners=True, padding_mode="border")
        value = self.layers(torch.cat([features.sum(0).squeeze(-1).T, places], dim=1)).squeeze(1)
        limit = torch.where(value < 0, -self._low, self._high)
        return torch.as_tensor(value / (1.0 + value.abs() / limit))


def unit_cube(points: Float[Tensor, "n 3"], body: Float[Tensor, "P 3"]) -> Float[Tensor, "n 3"]:
    """Points [m] such that the body just fits into the cube from -1 to 1, its shape kept."""
    low, high = body.amin(0), body.amax(0)
    return torch.as_tensor((points - (low + high) / 2) / ((high - low).max() / 2).clamp_min(1e-9))
