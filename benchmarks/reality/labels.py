"""What was withheld, written beside the worlds; how it is read is the business of those who judge by it."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from model.gap.benchmark.labels import LOG, PLAIN, SEALED, open_labels, seal

__all__ = ["LOG", "PLAIN", "SEALED", "open_labels", "write_labels"]


def write_labels(folder: Path, labels: list[dict[str, Any]], sealed: bool) -> Path:
    """Write them; returns the file."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(labels, indent=1, default=_plain)
    path = folder / (SEALED if sealed else PLAIN)
    path.write_bytes(seal(text.encode()) if sealed else text.encode())
    return path


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.round(value, 4).tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no place in labels")
