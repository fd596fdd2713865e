"""Files that are either whole or not there."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from model.errors import InputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; put it in the place of `path` when the block succeeds.

    The temporary file is empty, has the suffix of `path`, and is gone when the block fails: whatever `path`
    held before is then untouched. Missing folders are made.

    Raises:
        InputError: nothing can be written there.
    """
    check_writable(path)
    temporary = path.with_name(f".{path.stem[:100]}.{secrets.token_hex(6)}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise InputError(f"cannot write {path}: {(error.strerror or str(error)).lower()}") from None
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    _sync(path.parent)


def check_writable(path: Path) -> None:
    """Refuse early, before long work, a path that cannot become a file.

    Raises:
        InputError: `path` is a folder, or lies below something that is not a writable folder.
    """
    try:
        if path.is_dir():
            raise InputError(f"cannot write {path}: it is a folder, give the name of a file")
        if path.exists() and not path.is_file():  # /dev/null would be replaced for good
            raise InputError(f"cannot write {path}: it is a device or a pipe, give the name of a file")
        lost = next((folder for folder in (path, *path.absolute().parents) if _leads_nowhere(folder)), None)
        if lost is not None:
            raise InputError(f"cannot write {path}: {lost} is a link that leads nowhere")
        parent = next(folder for folder in path.absolute().parents if folder.exists())
    except OSError as error:
        raise InputError(f"cannot write {path}: {(error.strerror or str(error)).lower()}") from None
    if not parent.is_dir():
        raise InputError(f"cannot write {path}: {parent} is not a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"cannot write {path}: no permission to write in {parent}")


def _leads_nowhere(path: Path) -> bool:
    return path.is_symlink() and not path.exists()


def _sync(path: Path) -> None:
    """Flush a file or a folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
