import struct

import numpy as np
import pytest


def spring_changed(tensors: dict[str, np.ndarray], pair: tuple[int, int]) -> np.ndarray:
    springs = tensors["springs"].copy()
    springs[4] = pair
    return springs


def changed(values: np.ndarray, where: int, value: float) -> np.ndarray:
    values = values.copy()
    values.reshape(-1)[where] = value
    return values


BROKEN_TENSORS = {
    "index too large": (
        lambda t: {"springs": spring_changed(t, (0, 27))},
        "springs[4]: expected indices 0..26, found 27",
    ),
    "index negative": (
        lambda t: {"springs": spring_changed(t, (-1, 2))},
        "springs: expected indices from 0, found -1",
    ),
    "spring to itself": (
        lambda t: {"springs": spring_changed(t, (3, 3))},
        "springs[4]: expected two different points",
    ),
    "spring twice": (
        lambda t: {"springs": spring_changed(t, tuple(t["springs"][0][::-1]))},
        "expected every pair once",
    ),
    "springs of floats": (
        lambda t: {"springs": t["springs"].astype(np.float32)},
        "springs: expected int32 or int64, found F32",
    ),
    "points of integers": (
        lambda t: {"points": t["points"].astype(np.int32)},
        "points: expected float32 or float64, found I32",
    ),
    "half precision": (
        lambda t: {"mass": t["mass"].astype(np.float16)},
        "mass: expected float32 or float64, found F16",
    ),
    "NaN": (lambda t: {"points": changed(t["points"], 7, np.nan)}, "points[2]: expected finite"),
    "infinite": (lambda t: {"controls": changed(t["controls"], 0, np.inf)}, "controls[0]: expected finite"),
    "too large for float32": (
        lambda t: {"points": t["points"].astype(np.float64) * 1e300},
        "points[0]: expected finite",
    ),
    "too large for int32": (lambda t: {"part": t["part"].astype(np.int64) + 2**40}, "part: expected indices"),
    "massless": (
        lambda t: {"mass": changed(t["mass"], 3, 0)},
        "mass[3]: expected a positive number, found 0",
    ),
    "negative stiffness": (
        lambda t: {"stiffness": changed(t["stiffness"], 2, -1)},
        "stiffness[2]: expected a positive number",
    ),
    "no length": (
        lambda t: {"rest_length": changed(t["rest_length"], 0, 0)},
        "rest_length[0]: expected a positive number",
    ),
    "negative controller stiffness": (
        lambda t: {"controller_stiffness": -t["controller_stiffness"]},
        "controller_stiffness[0]: expected a number from 0",
    ),
    "missing tensor": (lambda t: {"mass": None}, "mass is missing"),
    "mass too short": (lambda t: {"mass": t["mass"][:-1]}, "mass: expected shape [27], found [26]"),
    "points of the plane": (
        lambda t: {"points": t["points"][:, :2]},
        "points: expected shape [N, 3], found [27, 2]",
    ),
    "no points": (
        lambda t: {n: t[n][:0] for n in ("points", "mass", "part", "springs", "rest_length", "stiffness")},
        "at least one point",
    ),
    "flat springs": (lambda t: {"springs": t["springs"].reshape(-1)}, "springs: expected shape [E, 2]"),
    "binding out of range": (
        lambda t: {"binding_index": t["binding_index"] + 1},
        "binding_index[26]: expected indices 0..26",
    ),
    "binding too light": (
        lambda t: {"binding_weight": t["binding_weight"] / 2},
        "binding_weight[0]: expected weights that sum to 1, found 0.5",
    ),
    "binding of too few": (
        lambda t: {n: t[n][:-1] for n in ("binding_index", "binding_weight")},
        "expected a row for each of the 27 Gaussians, found 26",
    ),
    "controller out of range": (
        lambda t: {"controller_springs": t["controller_springs"] + [2, 0]},
        "controller_springs[0]: expected indices 0..1, found 2",
    ),
    "controller springs without controllers": (
        lambda t: {"controls": None, "controller_points": None},
        "controller_springs[0]: expected none",
    ),
    "controls of others": (
        lambda t: {"controls": t["controls"][:, :1]},
        "controller_points: expected shape [1, 3], found [2, 3]",
    ),
}


@pytest.mark.parametrize("name", BROKEN_TENSORS)
def test_broken_tensors_are_refused(name: str, write_twin, tensors, refusal):
    change, expected = BROKEN_TENSORS[name]
    message = refusal(write_twin(**change(tensors)))
    assert expected in message
    assert "system.safetensors" in message


HUGE = struct.pack("<Q", 1 << 40)

BROKEN_FILES = {
    "system of text": (lambda m: {"system.safetensors": b"hello world"}, "expected a safetensors file"),
    "empty system": (lambda m: {"system.safetensors": b""}, "expected a safetensors file"),
    "system with a huge header": (
        lambda m: {"system.safetensors": HUGE + b"{}"},
        "expected a safetensors file",
    ),
    "truncated system": (
        lambda m: {"system.safetensors": m["system.safetensors"][:-9]},
        "system.safetensors: expected a safetensors file, found a damaged one",
    ),
}


@pytest.mark.parametrize("name", BROKEN_FILES)
def test_broken_files_are_refused(name: str, write_twin, members: dict[str, bytes], refusal):
    change, expected = BROKEN_FILES[name]
    assert expected in refusal(write_twin(files=change(members)))
