import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.observe.arrays_pickle import parse_pickled_arrays, read_pickled_arrays

CONTENT = {
    "points": np.arange(24, dtype=np.float32).reshape(2, 4, 3),
    "seen": np.array([[True, False]]),
    "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
}


class Runs:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("touch /tmp/matphys-was-here",)


class Huge:
    """An array of a billion numbers that no file holds."""

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return np.ndarray, ((1 << 30,),)


class HugeStart:
    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return np.empty(0).__reduce__()[0], (np.ndarray, (1 << 30,), b"b")


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_reads_arrays_of_every_protocol(protocol: int):
    read = parse_pickled_arrays(pickle.dumps(CONTENT | {"note": "text", 3: np.zeros(2)}, protocol), "c")
    assert set(read) == set(CONTENT)
    for name, value in CONTENT.items():
        np.testing.assert_array_equal(read[name], value)
        assert read[name].dtype == value.dtype


def test_reads_what_older_numpy_wrote():
    data = pickle.dumps(CONTENT, 4).replace(b"numpy._core.multiarray", b"numpy.core.multiarray")
    data = data.replace(b"\x8c\x16numpy.core", b"\x8c\x15numpy.core")
    assert b"numpy.core.multiarray" in data
    # The frame of protocol 4 says how long it is: protocol 2 has none.
    old = pickle.dumps(CONTENT, 2).replace(b"cnumpy._core.multiarray", b"cnumpy.core.multiarray")
    np.testing.assert_array_equal(parse_pickled_arrays(old, "c")["points"], CONTENT["points"])


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (Runs(), "found the global posix.system: refused"),
        ({"points": Runs()}, "found the global posix.system: refused"),
        (Huge(), "expected a whole pickle, found a damaged one"),
        (HugeStart(), "found another construction"),
        ({"points": np.array([{"a": 1}, None])}, "expected numbers, found object"),
        ([1, 2], "expected a dictionary of arrays, found list"),
        (InputError("x"), "found the global"),
    ],
)
def test_refuses_everything_else(content: object, expected: str):
    with pytest.raises(InputError) as caught:
        parse_pickled_arrays(pickle.dumps(content), "c.pkl")
    assert str(caught.value).startswith("c.pkl: ")
    assert expected in str(caught.value)
    assert not Path("/tmp/matphys-was-here").exists()


def test_refuses_damage_and_absence(tmp_path: Path):
    whole = pickle.dumps(CONTENT)
    for data in (b"", b"no pickle", whole[:-20], whole[: len(whole) // 2]):
        with pytest.raises(InputError, match=r"c\.pkl: expected a whole pickle"):
            parse_pickled_arrays(data, "c.pkl")
    with pytest.raises(InputError, match="no such file"):
        read_pickled_arrays(tmp_path / "c.pkl")
    (tmp_path / "c.pkl").write_bytes(whole)
    assert set(read_pickled_arrays(tmp_path / "c.pkl")) == set(CONTENT)
