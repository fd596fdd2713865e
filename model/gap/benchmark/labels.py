"""What was withheld from a diagnosis, in a file of its own that nobody reads by accident.

Labels of development worlds are plain JSON. Those of test worlds are sealed: packed and masked, with the
hash of their content beside it. `open_labels` wants the file of predictions, writes its hash, the time and
how often this was done into a log beside the labels, and only then unpacks. It is a seal, not a lock: it
shows that it was broken.
"""

import hashlib
import json
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import InputError

PLAIN, SEALED, LOG = "labels.json", "labels.sealed", "opened.json"
MAGIC = b"sealed labels of matphys worlds\n"
Label = dict[str, Any]
"""`world`, `category`, `effects` [{`name`, `amplitude`, `options`, `where`}], `accepted` answers, `acts_on`
{name: [N] 0..1}, `kind`, `interaction`, `magnitude` (of the gap after a refit, over what hides it; absent
where no effect was put in), and what else its maker notes."""


def open_labels(folder: Path, predictions: Path | None = None) -> list[Label]:
    """Read the labels of a folder.

    Args:
        folder: Where they lie.
        predictions: What was predicted, for sealed ones: its hash is logged first.

    Raises:
        InputError: no labels, sealed labels without predictions, or labels that were changed.
    """
    plain, sealed = folder / PLAIN, folder / SEALED
    check_labels(folder)
    if plain.is_file():
        return _parsed(plain.read_bytes(), plain)
    if predictions is None or not predictions.is_file():
        raise InputError(f"{sealed} is sealed: give the file of predictions, whose hash is logged first")
    _log(folder / LOG, predictions)
    return unseal(sealed)


def seal(text: bytes) -> bytes:
    """The content of a sealed file of labels."""
    return MAGIC + hashlib.sha256(text).digest() + masked(zlib.compress(text, 9))


def check_labels(folder: Path) -> None:
    """See that there are labels, and that it can be logged when they are opened, before hours of work.

    Raises:
        InputError: there are none, or nothing can be written beside sealed ones.
    """
    from model.formats.files import check_writable  # worlds are made without it: nothing of ours in them

    if (folder / PLAIN).is_file():
        return
    if not (folder / SEALED).is_file():
        raise InputError(f"{folder}: expected {PLAIN} or {SEALED} beside the worlds, found neither")
    check_writable(folder / LOG)


def unseal(path: Path) -> list[Label]:
    """The labels in a sealed file, for those who add to them; others ask `open_labels`.

    Raises:
        InputError: they were changed.
    """
    data = path.read_bytes()
    head = len(MAGIC)
    try:
        text = zlib.decompress(masked(data[head + 32 :]))
    except zlib.error:
        text = b""
    if not data.startswith(MAGIC) or hashlib.sha256(text).digest() != data[head : head + 32]:
        raise InputError(f"{path} was changed since it was sealed: make the worlds again")
    return _parsed(text, path)


def masked(data: bytes) -> bytes:
    """Unreadable to the eye; masked once more, as it was."""
    blocks = (hashlib.sha256(MAGIC + k.to_bytes(8, "big")).digest() for k in range(len(data) // 32 + 1))
    stream = np.frombuffer(b"".join(blocks), np.uint8)[: len(data)]
    return (np.frombuffer(data, np.uint8) ^ stream).tobytes()


def _log(log: Path, predictions: Path) -> None:
    from model.formats.files import replacing  # as above

    try:
        entries = json.loads(log.read_text()) if log.is_file() else []
    except ValueError:
        raise InputError(f"{log}: expected the log of when labels were opened, found no JSON") from None
    digest = hashlib.sha256(predictions.read_bytes()).hexdigest()
    entries.append({"predictions": digest, "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())})
    with replacing(log) as temporary:
        temporary.write_text(json.dumps(entries, indent=1))


def _parsed(text: bytes, path: Path) -> list[Label]:
    try:
        labels = json.loads(text)
        complete = all({"world", "effects", "accepted"} <= set(label) for label in labels)
    except (ValueError, TypeError):
        complete = False
    if not complete:
        raise InputError(f"{path}: expected a list of labels with world, effects and accepted, found others")
    return list(labels)
