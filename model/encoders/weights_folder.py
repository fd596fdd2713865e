"""Weights in a folder as the hub keeps them: `config.json` beside the tensors."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from model.errors import InputError, MissingDependencyError

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
WEIGHT_FILES = ("model.safetensors", "pytorch_model.bin")


def load_network(folder: Path, architectures: Mapping[str, str], who: str, title: str) -> tuple[Any, str]:
    """The frozen network in a folder, and the sha256 of its weights.

    Args:
        folder: Of the model.
        architectures: Class of transformers for each `model_type` that will do.
        who: Whose error it is if it cannot be loaded.
        title: What kind of model it should be.

    Raises:
        InputError: the folder holds no such model, or not all of it.
        MissingDependencyError: transformers is not installed.
    """
    architecture = _architecture(folder, architectures, who, title)
    digest = _sha256(folder, who)
    try:
        import transformers
    except ImportError:
        raise MissingDependencyError(f"{who} needs transformers: pip install 'matphys[weights]'") from None
    try:
        network, report = getattr(transformers, architecture).from_pretrained(
            folder, local_files_only=True, output_loading_info=True
        )
    except Exception as error:  # whatever the readers of each format raise
        line = " ".join(f"{error}".split())[:200] or type(error).__name__
        raise InputError(f"{who}: the weights in {folder} cannot be loaded: {line}") from None
    missing = sorted(report["missing_keys"])
    if missing:  # transformers would go on with random numbers in their place
        raise InputError(f"{who}: the weights in {folder} lack {missing[0]} and others; download them again")
    return network.eval().requires_grad_(False), digest


def _sha256(folder: Path, who: str) -> str:
    """Of the file with the tensors."""
    for name in WEIGHT_FILES:
        if (folder / name).is_file():
            with (folder / name).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
    raise InputError(f"{who}: {folder} has neither {' nor '.join(WEIGHT_FILES)}; download it again")


def _architecture(folder: Path, architectures: Mapping[str, str], who: str, title: str) -> str:
    """Name of the transformers class that `config.json` asks for."""
    config = folder / "config.json"
    if not config.is_file():
        raise InputError(f"{who}: {folder} has no config.json; give the folder of a {title} model")
    try:
        kind = json.loads(config.read_text(encoding="utf-8"))["model_type"]
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{who}: {config} does not say its model_type; download it again") from None
    if kind not in architectures:
        wanted = " or ".join(architectures)
        raise InputError(f"{who}: {folder} holds a {kind!r} model; give one of type {wanted}")
    return architectures[kind]
