"""Learned perceptual distance between pictures, with weights that the user brings."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor, nn

from model.errors import InputError, MissingDependencyError
from model.types import Array

TRUNK, HEADS = "alexnet.pth", "alex.pth"
"""Files of the weights folder: torchvision's AlexNet, and the linear heads of LPIPS 0.1 for it."""
SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)
_LAYERS = (
    (0, 3, 64, 11, 4, 2),
    (3, 64, 192, 5, 1, 2),
    (6, 192, 384, 3, 1, 1),
    (8, 384, 256, 3, 1, 1),
    (10, 256, 256, 3, 1, 1),
)
"""Place among torchvision's features, channels in and out, kernel, stride and padding."""
_POOLED = (3, 6)
"""Layers that come after a max-pooling."""


class Lpips(nn.Module):
    r"""$\sum_l \frac{1}{H_l W_l} \sum_{x} w_l \cdot (\hat f_l(x) - \hat g_l(x))^2$ over AlexNet's layers.

    $\hat f$ are features of unit length over the channels. AlexNet's weights come from torchvision
    (`alexnet-owt-7be5be79.pth`), the heads from the `lpips` package (`weights/v0.1/alex.pth`); neither is
    part of MatPhys.

    Args:
        folder: Holds `alexnet.pth` and `alex.pth`.

    Raises:
        MissingDependencyError: a file is absent.
        InputError: a file holds other weights.

    Reference:
        Zhang et al. (2018), The unreasonable effectiveness of deep features as a perceptual metric, eq. 1.
    """

    def __init__(self, folder: Path) -> None:
        """Read the weights."""
        super().__init__()
        self.names = tuple(str(layer[0]) for layer in _LAYERS)
        self.features = nn.ModuleDict(
            {
                str(name): nn.Conv2d(inputs, outputs, kernel, stride, padding)
                for name, inputs, outputs, kernel, stride, padding in _LAYERS
            }
        )
        self.heads = nn.ParameterList([nn.Parameter(torch.zeros(layer[2])) for layer in _LAYERS])
        self.pool = nn.MaxPool2d(3, 2)
        self._load(_weights(folder / TRUNK), _weights(folder / HEADS), folder)
        self.requires_grad_(False)

    def _load(self, trunk: dict[str, Tensor], heads: dict[str, Tensor], folder: Path) -> None:
        try:
            for name in self.names:
                layer = self.features[name]
                layer.load_state_dict({key: trunk[f"features.{name}.{key}"] for key in ("weight", "bias")})
            for k, head in enumerate(self.heads):
                head.data.copy_(heads[f"lin{k}.model.1.weight"].reshape(-1))
        except (KeyError, RuntimeError) as error:
            first = str(error).splitlines()[0]
            raise InputError(f"{folder}: expected weights of AlexNet and of LPIPS 0.1: {first}") from None

    def forward(self, first: Float[Tensor, "H W 3"], second: Float[Tensor, "H W 3"]) -> float:
        """Distance of two pictures with values 0..1, at least 32 pixels high and wide."""
        total = 0.0
        for head, one, other in zip(self.heads, self._unit(first), self._unit(second), strict=True):
            total += float(((one - other) ** 2 * head[:, None, None]).sum(dim=0).mean())
        return total

    def between(self, first: Float32[Array, "H W 3"], second: Float32[Array, "H W 3"]) -> float:
        """The same for arrays."""
        return float(self(torch.as_tensor(np.ascontiguousarray(first)), torch.as_tensor(second)))

    def _unit(self, image: Float[Tensor, "H W 3"]) -> list[Float[Tensor, "c h w"]]:
        """Features of each layer, of unit length over the channels."""
        value = (2.0 * image - 1.0 - image.new_tensor(SHIFT)) / image.new_tensor(SCALE)
        value = value.permute(2, 0, 1)[None]
        found = []
        for name in self.names:
            if int(name) in _POOLED:
                value = self.pool(value)
            value = torch.relu(self.features[name](value))
            found.append((value / (value.norm(dim=1, keepdim=True) + 1e-10))[0])
        return found


def _weights(path: Path) -> dict[str, Tensor]:
    if not path.is_file():
        raise MissingDependencyError(f"LPIPS needs {path}: bring its weights, or leave LPIPS out")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:
        raise InputError(f"{path}: not a file of weights: {type(error).__name__}") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected weights by name, found {type(content).__name__}")
    return {str(key): value for key, value in content.items()}
