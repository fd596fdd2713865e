"""What was withheld, written beside the worlds; how it is read is the business of those who judge by it."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from model.gap.benchmark.labels import PLAIN, SEALED, open_labels, seal, unseal


def write_labels(folder: Path, labels: list[dict[str, Any]], sealed: bool) -> Path:
    """Write them; returns the file."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(labels, indent=1, default=_plain)
    path = folder / (SEALED if sealed else PLAIN)
    new = path.with_suffix(".new")
    new.write_bytes(seal(text.encode()) if sealed else text.encode())
    new.replace(path)
    return path


def known_labels(folder: Path) -> list[dict[str, Any]]:
    """What is written there already, so that a folder can grow; nobody gets to see it."""
    if (folder / SEALED).is_file():
        return unseal(folder / SEALED)
    return open_labels(folder) if (folder / PLAIN).is_file() else []


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.round(value, 4).tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no place in labels")
