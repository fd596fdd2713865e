"""Zip archives: strangers' are read within limits, the bytes of our own depend on the content alone."""

import stat
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from model.errors import InputError

ENTRY_LIMIT = 256
DIRECTORY_LIMIT = 1 << 16
EPOCH = (1980, 1, 1, 0, 0, 0)
PICKLES = (".pkl", ".pickle", ".pt", ".pth", ".ckpt", ".joblib", ".dill")
STORED_AS_IS = (".mp4", ".png")
MEBIBYTE = 1 << 20


def read_archive(path: Path, limits: Mapping[str, int]) -> dict[str, bytes]:
    """Read the members named in `limits`; nothing is ever extracted to the disk.

    Members that nobody asked for are left unread, but one whose name is unsafe condemns the archive.

    Args:
        path: A zip archive.
        limits: Largest accepted size of each member [bytes].

    Raises:
        InputError: not a zip archive, damaged, unsafe or too large.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        _check_directory(path)
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            _check_names(path, entries)
            wanted = [entry for entry in entries if entry.filename in limits]
            return {entry.filename: _read(path, archive, entry, limits[entry.filename]) for entry in wanted}
    except InputError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError, struct.error) as error:
        raise InputError(
            f"{path.name}: expected a whole zip archive, found a damaged one ({error})"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None


def write_archive(path: Path, members: Mapping[str, bytes]) -> None:
    """Write `members` in their order, with fixed times, modes and compression."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.create_system = 3
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            packed = not name.endswith(STORED_AS_IS)
            entry.compress_type = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
            archive.writestr(entry, data, compresslevel=6 if packed else None)


def _check_directory(path: Path) -> None:
    """Bound the table of contents before `zipfile` builds an object for each of its lines."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - (1 << 16) - 64))
        tail = file.read()
    end = tail.rfind(b"PK\x05\x06")
    if end < 0 or len(tail) < end + 22:
        raise InputError(f"{path.name}: expected a zip archive, found {_kind(path)}")
    entries, directory_size = struct.unpack_from("<HI", tail, end + 10)
    wide = tail[max(0, end - 20) : end].startswith(b"PK\x06\x07")
    if wide or entries > ENTRY_LIMIT or directory_size > DIRECTORY_LIMIT:
        raise InputError(f"{path.name}: expected at most {ENTRY_LIMIT} members, found more")


def _kind(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(16)
    if not head:
        return "an empty file"
    return "a truncated one" if head.startswith(b"PK\x03\x04") else "something else"


def _check_names(path: Path, entries: list[zipfile.ZipInfo]) -> None:
    seen: set[str] = set()
    for entry in entries:
        name = entry.filename
        # zipfile cuts a name at NUL and turns backslashes around on some systems; the original tells.
        raw = entry.orig_filename
        unsafe = raw.startswith(("/", "\\")) or ":" in raw or "\\" in raw or "\0" in raw
        if unsafe or ".." in PurePosixPath(raw).parts:
            raise InputError(f"{path.name}: member {raw!r} points outside of the archive: refused")
        if name.lower().endswith(PICKLES):
            raise InputError(
                f"{path.name}: member {name!r} could be a pickle, which runs code when read: refused"
            )
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise InputError(f"{path.name}: member {name!r} is a symbolic link: refused")
        if name in seen:
            raise InputError(f"{path.name}: member {name!r} is there twice")
        seen.add(name)


def _read(path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo, limit: int) -> bytes:
    if entry.flag_bits & 0x1:
        raise InputError(f"{path.name}: member {entry.filename} is encrypted")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise InputError(f"{path.name}: member {entry.filename}: expected it stored or deflated")
    if entry.file_size > limit:
        expected = f"expected at most {limit / MEBIBYTE:g} MiB"
        raise InputError(
            f"{path.name}: member {entry.filename}: {expected}, found {entry.file_size / MEBIBYTE:.0f} MiB"
        )
    with archive.open(entry) as member:
        return member.read(limit + 1)
