"""What the Gaussians of a twin look like while it moves."""

import numpy as np
import torch
from jaxtyping import Float32

from model.bundle import TwinBundle
from model.rotations import matrices
from model.skinning import Skin
from model.types import Array


class Look:
    """Carries the Gaussians of a twin along with its points."""

    def __init__(self, bundle: TwinBundle) -> None:
        """See the class."""
        self._skin = Skin(bundle.gaussians, bundle.topology)
        self._variances = torch.as_tensor(bundle.gaussians.scales).square()

    def __call__(
        self, points: Float32[Array, "N 3"]
    ) -> tuple[Float32[Array, "G 3"], Float32[Array, "G 3 3"]]:
        """Centres [m] and covariances [m²] with the points at `points` [m]."""
        with torch.no_grad():
            means, quaternions = self._skin(torch.as_tensor(points))
            turned = matrices(quaternions)
            covariances = (turned * self._variances[:, None]) @ turned.transpose(1, 2)
        return means.numpy(), covariances.numpy()


def on_gaussians(bundle: TwinBundle, values: Float32[Array, "N c"]) -> Float32[Array, "G c"]:
    """Values of points as each Gaussian has them, by the points that it follows."""
    index, weight = bundle.topology.binding_index, bundle.topology.binding_weight
    spread: Float32[Array, "G c"] = np.einsum("gk,gkc->gc", weight, values[index]).astype(np.float32)
    return spread
