"""The only file that knows where bytes live: a folder or a bucket, by one URL.

Keys are made by us (`jobs/<id>/...`), never from what a client sent. A key is written once and whole: whoever
reads it reads all of it, whoever writes it second is refused.
"""

import hashlib
import mmap
import os
import re
import shutil
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import LocalStore, ObjectStore, from_url

from model.errors import InputError
from worker.record import JobFile

if TYPE_CHECKING:
    from obstore.store import ClientConfig, RetryConfig

CHUNK = 1 << 20
FETCHED = 8 * CHUNK
"""Bytes that are asked for at once where nobody waits to read them."""
PATIENCE_S = 20.0
SILENCE_S, LONGEST_S = 30.0, 3600.0
"""How long a bucket may take for what is small, and for a file that may be large and the way slow [s]."""
SMALL = 8 * CHUNK
"""Bytes that anybody's line carries within `SILENCE_S`."""
KEY = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*(/[A-Za-z0-9][A-Za-z0-9._-]*)*")


class StorageError(Exception):
    """The store cannot do it now: it is full, unreachable, or the key is not there."""


class Exists(StorageError):
    """The key is taken; it keeps what it had."""


class Storage:
    """Files by key.

    It must not be used before a fork: its threads do not come along.

    Args:
        url: `file:///folder` or `s3://bucket/prefix`; credentials, region and endpoint of the latter come
            from the environment (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT_URL`, ...).
        patience_s: How long a call to a bucket tries again before it raises [s].

    Raises:
        InputError: no such kind of store, or the folder cannot be made.
    """

    def __init__(self, url: str, patience_s: float = PATIENCE_S) -> None:
        """See the class."""
        self._store, self._folder = _open(url, patience_s, SILENCE_S)
        self._slow = self._store if self._folder is not None else _open(url, patience_s, LONGEST_S)[0]

    def publish(self, key: str, path: Path) -> JobFile:
        """Store the file at `path` under `key`, whole or not at all, and say what was stored.

        The same file may be published again, as when the answer to the first call was lost.

        Raises:
            Exists: the key is taken.
            StorageError: the store is full or unreachable.
        """
        _check(key)
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        size = path.stat().st_size
        try:
            with _mapped(path) as content:
                obstore.put(self._store if size <= SMALL else self._slow, key, content, mode="create")
            self._sync(key)
        except AlreadyExistsError:
            if not self._holds(key, digest):
                raise Exists(key) from None
        except (BaseError, OSError) as error:
            raise StorageError(_reason(error)) from error
        return JobFile(name=key.rpartition("/")[2], bytes=size, sha256=digest, key=key)

    def fetch(self, key: str, path: Path) -> None:
        """Write what is stored under `key` to the file `path`.

        Raises:
            StorageError: there is no such key, or the store is unreachable.
        """
        with path.open("wb") as file:
            for chunk in self._pieces(key, 0, None, FETCHED):
                file.write(chunk)

    def size(self, key: str) -> int | None:
        """Bytes stored under `key`; None: nothing is."""
        try:
            return int(obstore.head(self._store, _check(key))["size"])
        except FileNotFoundError:
            return None
        except BaseError as error:
            raise StorageError(_reason(error)) from error

    def stream(self, key: str, start: int = 0, end: int | None = None) -> Iterator[bytes]:
        """The bytes `start` to `end` (exclusive; None: the last) of what is stored under `key`, in pieces.

        Each is asked for by itself when it is wanted: a reader may be as slow as it likes.

        Raises:
            StorageError: there is no such key, or the store is unreachable.
        """
        return self._pieces(key, start, end, CHUNK)

    def _pieces(self, key: str, start: int, end: int | None, length: int) -> Iterator[bytes]:
        size = self.size(key)
        if size is None:
            raise StorageError(f"{key} is not stored")
        end = size if end is None else min(end, size)
        try:
            for at in range(start, end, length):
                yield bytes(obstore.get_range(self._store, key, start=at, end=min(at + length, end)))
        except (BaseError, OSError) as error:
            raise StorageError(_reason(error)) from error

    def list(self, prefix: str = "") -> Sequence[str]:
        """All keys below a prefix."""
        if prefix:
            _check(prefix.removesuffix("/"))
        try:
            return sorted(each["path"] for page in obstore.list(self._store, prefix or None) for each in page)
        except BaseError as error:
            raise StorageError(_reason(error)) from error

    def delete(self, prefix: str) -> None:
        """Delete everything below a prefix that ends with `/`, or the one key; a second time does nothing.

        Raises:
            StorageError: the store is unreachable.
        """
        _check(prefix.removesuffix("/"))
        if self._folder is not None:  # the folders go too, and what a killed writer left half written
            place = self._folder / prefix
            shutil.rmtree(place, ignore_errors=True) if prefix.endswith("/") else place.unlink(
                missing_ok=True
            )
            return
        keys = self.list(prefix) if prefix.endswith("/") else [prefix]
        try:
            obstore.delete(self._store, keys)
        except BaseError as error:
            raise StorageError(_reason(error)) from error

    def writable(self) -> bool:
        """Whether a file can be written, read and deleted now."""
        key, text = f"probe/{uuid.uuid4().hex}", str(time.time()).encode()
        try:
            obstore.put(self._store, key, text, mode="create")
            same = bytes(obstore.get(self._store, key).bytes()) == text
            obstore.delete(self._store, key)
        except (BaseError, OSError):
            return False
        return same

    def free_bytes(self) -> int | None:
        """Room left on the file system of a folder; None: a bucket does not say."""
        return None if self._folder is None else shutil.disk_usage(self._folder).free

    def _holds(self, key: str, digest: str) -> bool:
        """Whether a key has the content of this sha256."""
        stored = hashlib.sha256()
        for chunk in self.stream(key):
            stored.update(chunk)
        return stored.hexdigest() == digest

    def _sync(self, key: str) -> None:
        """Have a stored file, and its name, on the disk before anybody is told of it."""
        if self._folder is not None:
            place = self._folder / key
            for path in (place, place.parent):
                descriptor = os.open(path, os.O_RDONLY)
                try:
                    os.fsync(descriptor)
                finally:
                    os.close(descriptor)


@contextmanager
def _mapped(path: Path) -> Iterator[bytes | mmap.mmap]:
    """What is in a file, without holding it in memory: a file to be created is sent in one piece."""
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:  # nothing cannot be mapped
            yield b""
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            yield content


def _open(url: str, patience_s: float, longest_s: float) -> tuple[ObjectStore, Path | None]:
    parts = urlsplit(url)
    if parts.scheme == "file" and not parts.netloc:
        folder = Path(unquote(parts.path))
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{url}: cannot be made ({error.strerror})") from None
        return LocalStore(folder), folder
    if parts.scheme == "s3" and parts.netloc:
        plain = os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://")
        settings: ClientConfig = {
            "allow_http": plain,
            "timeout": timedelta(seconds=longest_s),
            "connect_timeout": "5s",
        }
        retries: RetryConfig = {"max_retries": 10, "retry_timeout": timedelta(seconds=patience_s)}
        return from_url(url, client_options=settings, retry_config=retries), None
    raise InputError(f"{url}: expected file:///FOLDER or s3://BUCKET/PREFIX")


def _check(key: str) -> str:
    """Keys are ours: one that is not of their form is a fault of the caller."""
    if not KEY.fullmatch(key):
        raise ValueError(f"not a key of the store: {key!r}")
    return key


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
