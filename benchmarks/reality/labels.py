"""What was withheld, in a file of its own that nobody reads by accident.

Labels of development worlds are plain JSON. Those of test worlds are sealed: packed and masked, with the
hash of their content beside the worlds. `open_labels` wants the file of predictions, writes its hash, the
time and how often this was done into a log beside the labels, and only then unpacks. It is a seal, not a
lock: it shows that it was broken.
"""

import hashlib
import json
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np

PLAIN, SEALED, LOG = "labels.json", "labels.sealed", "opened.json"
MAGIC = b"sealed labels of matphys worlds\n"


def write_labels(folder: Path, labels: list[dict[str, Any]], sealed: bool) -> Path:
    """Write them; returns the file."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(labels, indent=1, default=_plain)
    if not sealed:
        path = folder / PLAIN
        path.write_text(text)
        return path
    packed = zlib.compress(text.encode(), 9)
    path = folder / SEALED
    path.write_bytes(MAGIC + hashlib.sha256(text.encode()).digest() + _mask(packed))
    return path


def open_labels(folder: Path, predictions: Path | None = None) -> list[dict[str, Any]]:
    """Read the labels of a folder.

    Args:
        folder: Where they lie.
        predictions: What was predicted, for sealed ones: its hash is logged first.

    Raises:
        ValueError: sealed labels without predictions, or labels that were changed.
    """
    if (folder / PLAIN).is_file():
        content: list[dict[str, Any]] = json.loads((folder / PLAIN).read_text())
        return content
    if predictions is None or not predictions.is_file():
        raise ValueError(
            f"{folder / SEALED} is sealed: give the file of predictions, whose hash is logged first"
        )
    log = folder / LOG
    entries = json.loads(log.read_text()) if log.is_file() else []
    digest = hashlib.sha256(predictions.read_bytes()).hexdigest()
    entries.append({"predictions": digest, "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())})
    log.write_text(json.dumps(entries, indent=1))
    data = (folder / SEALED).read_bytes()
    head = len(MAGIC)
    text = zlib.decompress(_mask(data[head + 32 :]))
    if not data.startswith(MAGIC) or hashlib.sha256(text).digest() != data[head : head + 32]:
        raise ValueError(f"{folder / SEALED} was changed")
    content = json.loads(text)
    return content


def _mask(data: bytes) -> bytes:
    blocks = (hashlib.sha256(MAGIC + k.to_bytes(8, "big")).digest() for k in range(len(data) // 32 + 1))
    stream = np.frombuffer(b"".join(blocks), np.uint8)[: len(data)]
    return (np.frombuffer(data, np.uint8) ^ stream).tobytes()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.round(value, 4).tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no place in labels")
