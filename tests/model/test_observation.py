import warnings
from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.observation import parse_observation, read_observation, write_observation
from model.observation_doubts import observation_doubts

FRAMES, POINTS = 30, 12


def arrays(**changes: object) -> dict[str, np.ndarray]:
    """A plush held at its top and moved up; a value of None takes the key away."""
    rng = np.random.default_rng(0)
    times = np.arange(FRAMES) / 30.0
    lift = np.stack([0.0 * times, 0.0 * times, 0.2 * times], axis=1)[:, None]
    points = (rng.uniform(-0.1, 0.1, (POINTS, 3)) + np.array([0.0, 0.0, 1.0]) + lift).astype(np.float32)
    points[3:6, 4] = np.nan
    content = {
        "times": times,
        "points": points,
        "controllers": (np.array([[[0.0, 0.0, 1.1]]]) + lift).astype(np.float32),
    } | changes
    return {key: np.asarray(value) for key, value in content.items() if value is not None}


def doubts(**changes: object) -> str:
    return "\n".join(observation_doubts(parse_observation(arrays(**changes), "o.npz")))


def save(folder: Path, **changes: object) -> Path:
    path = folder / "o.npz"
    np.savez(path, **arrays(**changes))
    return path


def test_round_trip_is_exact_and_silent(tmp_path: Path):
    full = arrays(
        ground_height=0.25,
        gravity=[0.0, 0.1, -9.8],
        colors=np.full((POINTS, 3), 200, np.uint8),
        parts=np.arange(POINTS),
    )
    path = save(tmp_path, **full)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first = read_observation(path)
        write_observation(tmp_path / "again.npz", first)
        second = read_observation(tmp_path / "again.npz")
    assert first.points.dtype == np.float32
    assert first.ground_height == 0.25
    assert first.gravity == (0.0, 0.1, -9.8)
    for name, value in full.items():
        np.testing.assert_array_equal(getattr(first, name), value)
        np.testing.assert_array_equal(getattr(second, name), value)
    write_observation(tmp_path / "third.npz", second)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "third.npz").read_bytes()


def test_what_is_optional_may_be_absent_or_unknown(tmp_path: Path):
    observation = read_observation(save(tmp_path, note="ignored"))
    assert observation.ground_height is None
    assert observation.gravity == (0.0, 0.0, -9.81)
    assert observation.colors is None
    assert observation.parts is None
    assert read_observation(save(tmp_path, ground_height=np.nan)).ground_height is None


def test_a_point_with_one_coordinate_missing_is_not_seen():
    points = arrays()["points"]
    points[2, 3, 1] = np.nan
    assert np.isnan(parse_observation(arrays(points=points), "o").points[2, 3]).all()


def infinite() -> np.ndarray:
    points = arrays()["points"]
    points[1, 1, 1] = np.inf
    return points


def once() -> np.ndarray:
    points = arrays()["points"]
    points[1:] = np.nan
    return points


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"times": None}, "times: expected [T] seconds, strictly increasing, found no such key"),
        ({"points": None}, "points: expected [T, N, 3] metres, NaN where not seen, found no such key"),
        (
            {"controllers": None},
            "controllers: expected [T, C, 3] metres (C = 0 where nothing is held), found no",
        ),
        ({"times": np.zeros((2, 3))}, "times: expected [T] seconds, strictly increasing, found shape [2, 3]"),
        ({"times": np.zeros(1)}, "times: expected at least 2 frames, found 1"),
        ({"times": np.full(FRAMES, np.nan)}, "times: expected finite seconds, found NaN"),
        (
            {"times": np.zeros(FRAMES)},
            "times: expected strictly increasing seconds, found 0 then 0 at frame 1",
        ),
        ({"times": np.arange(FRAMES) * 33.3}, "times: expected seconds, found 33.3 between frames: milli"),
        ({"points": np.zeros((FRAMES, 3))}, "points: expected shape [30, N, 3] with N > 0, found [30, 3]"),
        (
            {"points": np.zeros((FRAMES, 0, 3))},
            "points: expected shape [30, N, 3] with N > 0, found [30, 0, 3]",
        ),
        (
            {"points": arrays()["points"][1:]},
            "points: expected shape [30, N, 3] with N > 0, found [29, 12, 3]",
        ),
        ({"points": infinite()}, "points: expected metres, NaN where not seen, found infinity"),
        (
            {"points": np.full((FRAMES, 5, 3), np.nan)},
            "points: expected some points seen, found NaN everywhere",
        ),
        ({"points": once()}, "points: expected points seen in 2 frames, found only one"),
        ({"points": arrays()["points"] * 1000.0}, "points: expected an object of 0.001 to 10 m, found"),
        ({"points": arrays()["points"] / 1000.0}, "points: expected an object of 0.001 to 10 m, found"),
        ({"controllers": np.zeros((3, 1, 3))}, "controllers: expected shape [30, C, 3], found [3, 1, 3]"),
        (
            {"controllers": np.full((FRAMES, 1, 3), np.nan)},
            "controllers: expected finite metres in all frames",
        ),
        ({"controllers": arrays()["controllers"] * 1000.0}, "controllers: expected metres, in the frame of"),
        ({"ground_height": [1.0, 2.0]}, "ground_height: expected one number, found shape [2]"),
        ({"ground_height": np.inf}, "ground_height: expected metres, or NaN for no ground, found infinity"),
        ({"gravity": 9.81}, "gravity: expected shape [3], found []"),
        ({"gravity": [0, 0, -9810]}, "gravity: expected m/s², at most 100, found 9810"),
        ({"gravity": [0, 0, np.nan]}, "gravity: expected m/s², at most 100, found nan"),
        ({"colors": np.zeros((4, 3), np.uint8)}, "colors: expected shape [12, 3], found [4, 3]"),
        ({"colors": np.full((POINTS, 3), 300)}, "colors: expected uint8 numbers, found 300 to 300"),
        ({"colors": np.ones((POINTS, 3))}, "colors: expected uint8 numbers, found float64"),
        ({"parts": np.zeros(POINTS)}, "parts: expected int64 numbers, found float64"),
        ({"points": np.full((FRAMES, 5, 3), "a")}, "points: expected numbers, found <U1"),
        ({"points": np.full((FRAMES, 5, 3), None)}, "points: expected numbers, found object"),
    ],
)
def test_refuses_in_one_line(tmp_path: Path, changes: dict[str, object], expected: str):
    with pytest.raises(InputError) as caught:
        read_observation(save(tmp_path, **changes))
    assert str(caught.value).startswith(f"o.npz: {expected}")
    assert "\n" not in str(caught.value)


def test_a_hanging_object_that_nothing_holds_is_doubted():
    still = np.repeat(arrays()["points"][:1], FRAMES, axis=0)
    free = {"controllers": np.zeros((FRAMES, 0, 3), np.float32)}
    assert "nothing holds it" in doubts(points=still, **free)
    assert "nothing holds it" in doubts(points=still, ground_height=0.0, **free)
    assert "nothing holds it" not in doubts(points=still, ground_height=0.9, **free), "it lies on the ground"
    assert "nothing holds it" not in doubts(points=still), "the hand holds it"
    times = arrays()["times"]
    falling = still + np.array([0.0, 0.0, -4.905], np.float32) * (times**2)[:, None, None].astype(np.float32)
    assert "nothing holds it" not in doubts(points=falling, **free)
    assert "nothing holds it" not in doubts(points=still, gravity=[0.0, 0.0, 0.0], **free)


def fallen(times, linear=0.0, quadratic=0.0, thrown=0.0, gravity=9.81):
    """How far something has fallen [m] that air slows, in small steps."""
    fine, speed, way, places = 1e-4, -thrown, 0.0, []
    for step in range(round(times[-1] / fine) + 2):
        if step * fine >= times[len(places)] - 1e-9:
            places.append(way)
            if len(places) == len(times):
                break
        speed += fine * (gravity - linear * speed - quadratic * abs(speed) * speed)
        way += fine * speed
    return np.array(places)


@pytest.mark.parametrize("span", [0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize(
    "air",
    [
        {},
        {"linear": 4.0},
        {"quadratic": 1.5},
        {"thrown": 2.0},
        {"thrown": 2.0, "linear": 4.0},
        {"thrown": 2.0, "quadratic": 1.5},
    ],
)
def test_what_air_slows_falls(span, air):
    times = np.linspace(0.0, span, FRAMES)
    points = np.repeat(arrays()["points"][:1], FRAMES, axis=0)
    points[..., 2] -= fallen(times, **air)[:, None]
    points += np.random.default_rng(1).normal(0, 0.003, points.shape)
    free = {"controllers": np.zeros((FRAMES, 0, 3), np.float32)}
    assert "nothing holds it" not in doubts(times=times, points=points, **free)


@pytest.mark.parametrize(
    "height",
    [
        lambda t: 0.05 * np.cos(9.0 * t),
        lambda t: 0.02 * np.sin(30.0 * t),
        lambda t: -0.15 * t,
        lambda t: 0.2 * t,
        lambda t: -0.1 * (1 - np.cos(3.0 * t)),
    ],
    ids=["bobs", "shakes", "is lowered", "is lifted", "sinks"],
)
def test_what_nobody_is_seen_to_hold_hangs(height):
    times = np.linspace(0.0, 1.5, FRAMES)
    points = np.repeat(arrays()["points"][:1], FRAMES, axis=0)
    points[..., 2] += height(times)[:, None]
    free = {"controllers": np.zeros((FRAMES, 0, 3), np.float32)}
    assert "nothing holds it" in doubts(times=times, points=points, **free)


def test_doubts_name_what_is_odd():
    lost = arrays()["points"]
    lost[10, 2] += 5.0
    rare = arrays()["points"]
    rare[2:, 0] = np.nan
    blind = arrays()["points"]
    blind[7] = np.nan
    alternating = arrays()["points"]
    alternating[::2] = np.nan
    assert doubts() == ""
    assert "lost track" in doubts(points=lost)
    assert "1 of 12 points are seen in fewer than 3" in doubts(points=rare)
    assert "nothing is seen in 1 of 30 frames" in doubts(points=blind)
    assert "no point is seen in two frames in a row" in doubts(points=alternating)
    assert "too short" in doubts(times=np.linspace(0.0, 0.1, FRAMES))
    assert "too long" in doubts(times=np.arange(FRAMES) * 1.0)
    assert "it holds none" in doubts(controllers=arrays()["controllers"] + np.float32(1.0))
    assert "gravity points up" in doubts(gravity=[0.0, 0.0, 9.81])
    assert "is another axis than z up?" in doubts(gravity=[0.0, -9.81, 0.0])
    assert doubts(gravity=[4.0, 0.0, -9.0]) == "", "a set-up may be tilted"
    assert "gravity: 0 m/s² pulls nothing down" in doubts(gravity=[0.0, 0.0, 0.0])
    large = {key: 20.0 * arrays()[key] for key in ("points", "controllers")}
    assert "is it in centimetres?" in doubts(**large)


def test_what_moves_in_the_first_frame_is_doubted():
    """A twin is at rest there; who is pulled away at once is, too."""
    times = np.arange(FRAMES) / 30
    noise = np.random.default_rng(0).normal(0, 2e-3, arrays()["points"].shape)
    still = arrays()["points"][:1] + noise
    for away, doubted in (
        (0.5 * times, True),
        (3.0 * times**2, False),
        (np.maximum(0.5 * (times - 0.03), 0.0), False),
        (0.0 * times, False),
    ):
        points = (still + away[:, None, None] * np.array([0.8, 0.6, 0.0])).astype(np.float32)
        said = doubts(times=times, points=points)
        assert ("m/s in the first frame" in said) == doubted


def test_a_hand_that_jumps_is_doubted():
    lost = arrays()["controllers"].copy()
    lost[12] += np.float32(2.0)
    assert "controllers: one moves at" in doubts(controllers=lost)
    assert "after frame 11" in doubts(controllers=lost)


def test_gravity_that_is_a_direction_is_doubted():
    assert "is it a direction alone?" in doubts(gravity=[0.0, 0.0, -1.0])
    assert doubts(gravity=[0.0, 0.0, -1.62]) == "", "on the Moon"


def test_warnings_carry_the_name_of_the_file(tmp_path: Path):
    with pytest.warns(UserWarning, match=r"o\.npz: gravity points up"):
        read_observation(save(tmp_path, gravity=[0.0, 0.0, 9.81]))
