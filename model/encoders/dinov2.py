"""DINOv2 patch features from a weights folder on this machine."""

import os
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from model.encoders.base import SemanticEncoder
from model.encoders.weights_folder import IMAGENET_MEAN, IMAGENET_STD, load_network
from model.errors import InputError
from model.types import Array

WEIGHTS_VARIABLE = "MATPHYS_DINOV2"
LONG_SIDE = 518
"""The resolution DINOv2 was finished at [px]."""
WHO = "dinov2 encoder"
ARCHITECTURES = {"dinov2": "Dinov2Model", "dinov2_with_registers": "Dinov2WithRegistersModel"}


class Dinov2Encoder(SemanticEncoder):
    """Patch tokens of DINOv2, with or without registers.

    The folder is what the hub calls a model: `config.json` beside `model.safetensors`
    (`huggingface-cli download facebook/dinov2-with-registers-large --local-dir FOLDER`). Nothing is
    downloaded from here.

    Reference:
        Oquab et al. (2023), DINOv2: learning robust visual features without supervision;
        Darcet et al. (2024), Vision transformers need registers.
    """

    name: ClassVar[str] = "dinov2"
    version: ClassVar[str] = "1"

    def __init__(self, folder: str | Path | None = None) -> None:
        """Load the weights.

        Args:
            folder: Where the weights lie; left out, the environment variable `MATPHYS_DINOV2` says it.

        Raises:
            InputError: no folder was given, or it holds no DINOv2 model.
            MissingDependencyError: transformers is not installed.
        """
        super().__init__()
        chosen = folder or os.environ.get(WEIGHTS_VARIABLE)
        if not chosen:
            raise InputError(f"{WHO}: no weights; set {WEIGHTS_VARIABLE} to a folder of the model")
        path = Path(chosen).expanduser()
        self.network, self.weights = load_network(path, ARCHITECTURES, WHO, "DINOv2")
        self.dim = int(self.network.config.hidden_size)
        self.patch = int(self.network.config.patch_size)
        # CLS comes first, then the registers of the architecture that has them.
        self.extra_tokens = 1 + int(getattr(self.network.config, "num_register_tokens", 0))

    def forward(self, image: UInt8[Array, "H W 3"]) -> Float32[Array, "h w D"]:
        """One feature per patch; the long side of the image is resized to about 518 px."""
        scale = LONG_SIDE / max(image.shape[:2])
        rows, columns = (max(1, round(side * scale / self.patch)) for side in image.shape[:2])
        pixels = _pixels(image, rows * self.patch, columns * self.patch)
        with torch.no_grad():
            tokens = self.network(pixel_values=pixels).last_hidden_state[0, self.extra_tokens :]
        features: Float32[Array, "h w D"] = tokens.reshape(rows, columns, self.dim).numpy()
        return features


def _pixels(image: UInt8[Array, "H W 3"], height: int, width: int) -> torch.Tensor:
    """Resized and normalised as in training, shape [1, 3, height, width]."""
    shrinks = height < image.shape[0]
    resized = cv2.resize(
        image.astype(np.float32) / 255.0,
        (width, height),
        interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC,
    )
    normal = (resized - np.array(IMAGENET_MEAN, np.float32)) / np.array(IMAGENET_STD, np.float32)
    return torch.from_numpy(np.ascontiguousarray(normal.transpose(2, 0, 1)))[None]
