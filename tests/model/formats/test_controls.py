from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.formats.controls import read_controls

MOTION = np.zeros((3, 2, 3), np.float32)
NOT_FINITE = MOTION.copy()
NOT_FINITE[1, 0, 2] = np.nan


def test_reads_motion_and_times(tmp_path: Path):
    path = tmp_path / "c.npz"
    motion = np.asfortranarray(np.random.default_rng(0).normal(size=(3, 2, 3)))
    np.savez_compressed(path, controls=motion, times=np.array([0, 1, 3]), more=np.array(["text"]))
    controls = read_controls(path, 2)
    np.testing.assert_allclose(controls.motion, motion, rtol=1e-6)
    np.testing.assert_array_equal(controls.times, [0, 1, 3])


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({}, "controls is missing: expected an array [T, 2, 3]"),
        ({"controls": MOTION[:, :1]}, "controls: expected shape [T, 2, 3], found [3, 1, 3]"),
        ({"controls": MOTION[0]}, "controls: expected shape [T, 2, 3], found [2, 3]"),
        ({"controls": MOTION[:0]}, "found [0, 2, 3]"),
        ({"controllers": NOT_FINITE}, "controllers[1]: expected finite numbers"),
        ({"controls": np.full((1, 2, 3), 1e300)}, "controls[0]: expected finite numbers"),
        ({"controls": np.array([["a"]])}, "controls: expected numbers, found <U1"),
        ({"controls": np.array([{"a": 1}, None])}, "controls: expected numbers, found object"),
        ({"controls": MOTION, "times": np.arange(4)}, "times: expected shape [3], found [4]"),
        ({"controls": MOTION, "times": np.array([0, 1, 1])}, "strictly increasing"),
        ({"controls": MOTION, "times": np.array([0, np.nan, 1])}, "strictly increasing"),
    ],
)
def test_refuses(tmp_path: Path, arrays: dict[str, np.ndarray], expected: str):
    path = tmp_path / "c.npz"
    np.savez(path, **{"nothing": np.zeros(1)} | arrays)
    with pytest.raises(InputError) as caught:
        read_controls(path, 2)
    assert expected in str(caught.value)
    assert str(caught.value).startswith("c.npz: ")
