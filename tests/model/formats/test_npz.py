import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.formats.npz import read_arrays


def write(path: Path, content: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", content)
    return path


def npy(shape: tuple[int, ...], data: bytes) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": shape})
    return stream.getvalue() + data


def headed(header: bytes) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def test_reads_only_what_is_asked_for(tmp_path: Path):
    np.savez(tmp_path / "x.npz", a=np.arange(6).reshape(2, 3), b=np.array([None]))
    arrays = read_arrays(tmp_path / "x.npz", ("a", "c"))
    assert list(arrays) == ["a"]
    np.testing.assert_array_equal(arrays["a"], [[0, 1, 2], [3, 4, 5]])


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "expected an array as numpy.savez writes it"),
        (b"hello world", "expected an array as numpy.savez writes it"),
        (headed(b"nonsense\n"), "expected an array as numpy.savez writes it"),
        (headed(b"(" * 100), "expected an array as numpy.savez writes it"),
        (headed(b"-" * 5000 + b"1"), "expected an array as numpy.savez writes it"),
        (npy((-1, -2), bytes(8)), "expected an array as numpy.savez writes it"),
        (npy((True, 2), bytes(8)), "expected an array as numpy.savez writes it"),
        (npy((0, 10**30), b""), "expected an array as numpy.savez writes it"),
        (npy((10**15,), bytes(8)), "found a file of another length"),
        (npy((3,), bytes(8)), "expected 3 numbers"),
    ],
)
def test_refuses(tmp_path: Path, content: bytes, expected: str):
    with pytest.raises(InputError, match=r"x\.npz: a: ") as caught:
        read_arrays(write(tmp_path / "x.npz", content), ("a",))
    assert expected in str(caught.value)


def test_a_file_that_is_no_archive(tmp_path: Path):
    np.save(tmp_path / "x.npy", np.zeros(3))
    with pytest.raises(InputError, match="expected a zip archive"):
        read_arrays(tmp_path / "x.npy", ("a",))
