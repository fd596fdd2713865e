"""DINOv2 patch features from a weights folder on this machine."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from model.encoders.base import SemanticEncoder
from model.errors import InputError, MissingDependencyError
from model.types import Array

WEIGHTS_VARIABLE = "MATPHYS_DINOV2"
LONG_SIDE = 518
"""The resolution DINOv2 was finished at [px]."""
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
WEIGHT_FILES = ("model.safetensors", "pytorch_model.bin")
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
            raise InputError(f"dinov2 encoder: no weights; set {WEIGHTS_VARIABLE} to a folder of the model")
        path = Path(chosen).expanduser()
        architecture = _architecture(path)
        self.weights = _sha256(_weights_file(path))
        self.network = _load(path, architecture)
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


def _architecture(folder: Path) -> str:
    """Name of the transformers class that `config.json` asks for."""
    config = folder / "config.json"
    if not config.is_file():
        raise InputError(f"dinov2 encoder: {folder} has no config.json; give the folder of a DINOv2 model")
    try:
        kind = json.loads(config.read_text(encoding="utf-8"))["model_type"]
    except (ValueError, KeyError, TypeError):
        raise InputError(f"dinov2 encoder: {config} does not say its model_type; download it again") from None
    if kind not in ARCHITECTURES:
        wanted = " or ".join(ARCHITECTURES)
        raise InputError(f"dinov2 encoder: {folder} holds a {kind!r} model; give one of type {wanted}")
    return ARCHITECTURES[kind]


def _weights_file(folder: Path) -> Path:
    for name in WEIGHT_FILES:
        if (folder / name).is_file():
            return folder / name
    raise InputError(f"dinov2 encoder: {folder} has neither {' nor '.join(WEIGHT_FILES)}; download it again")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _load(folder: Path, architecture: str) -> Any:  # noqa: ANN401 - transformers' classes are untyped
    try:
        import transformers
    except ImportError:
        raise MissingDependencyError(
            "dinov2 encoder needs transformers: pip install 'matphys[weights]'"
        ) from None
    try:
        network, report = getattr(transformers, architecture).from_pretrained(
            folder, local_files_only=True, output_loading_info=True
        )
    except Exception as error:  # whatever the readers of each format raise
        line = " ".join(f"{error}".split())[:200] or type(error).__name__
        raise InputError(f"dinov2 encoder: the weights in {folder} cannot be loaded: {line}") from None
    missing = sorted(report["missing_keys"])
    if missing:  # transformers would go on with random numbers in their place
        raise InputError(
            f"dinov2 encoder: the weights in {folder} lack {missing[0]} and others; download them again"
        )
    return network.eval().requires_grad_(False)
