import pickle
from pathlib import Path

import numpy as np
import pytest

from model.cli import main
from model.errors import InputError
from model.observation import read_observation
from model.observe.phystwin import observe_phystwin

FRAMES, POINTS = 8, 5


def case(**changes: object) -> dict[str, np.ndarray]:
    """Points 10 to 20 cm above a table, in a world with z down."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.1, -0.1, -0.2], [0.1, 0.1, -0.1], (FRAMES, POINTS, 3))
    content = {
        "object_points": points,
        "object_colors": np.tile(np.array([1.0, 0.5, 0.0]), (FRAMES, POINTS, 1)),
        "object_visibilities": np.ones((FRAMES, POINTS), bool),
        "object_motions_valid": np.ones((FRAMES, POINTS), bool),
        "controller_points": np.tile(np.array([0.0, 0.1, -0.2]), (FRAMES, 30, 1)),
        "surface_points": np.zeros((3, 3)),
    } | changes
    return {key: value for key, value in content.items() if value is not None}


def save(folder: Path, **changes: object) -> Path:
    path = folder / "final_data.pkl"
    path.write_bytes(pickle.dumps(case(**changes)))
    return path


def test_turns_the_world_upright_and_keeps_hands_and_colours(tmp_path: Path):
    observation = observe_phystwin(save(tmp_path))
    expected = case()["object_points"] * [1.0, -1.0, -1.0]
    np.testing.assert_allclose(observation.points, expected, atol=1e-7)
    assert (observation.points[..., 2] > 0.09).all(), "above the table"
    np.testing.assert_allclose(observation.controllers[0, 7], [0.0, -0.1, 0.2], atol=1e-7)
    np.testing.assert_allclose(observation.times, np.arange(FRAMES) / 30.0)
    assert observation.ground_height == 0.0
    assert observation.gravity == (0.0, 0.0, -9.81)
    assert observation.colors is not None
    np.testing.assert_array_equal(observation.colors[0], [255, 128, 0])


def test_hidden_and_invalid_points_are_not_seen(tmp_path: Path):
    visible, valid = np.ones((FRAMES, POINTS), bool), np.ones((FRAMES, POINTS), bool)
    visible[2, 1] = False
    valid[4, 3] = False  # the motion from frame 4 to 5
    observation = observe_phystwin(save(tmp_path, object_visibilities=visible, object_motions_valid=valid))
    unseen = np.argwhere(np.isnan(observation.points[..., 0]))
    np.testing.assert_array_equal(unseen, [[2, 1], [5, 3]])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"object_points": None}, "object_points: expected an array of numbers, found no such key"),
        ({"controller_points": None}, "controller_points: expected an array of numbers, found no such key"),
        ({"object_points": np.zeros((3, 3))}, "object_points: expected shape [T, N, 3], found [3, 3]"),
        (
            {"controller_points": np.zeros((8, 4))},
            "controller_points: expected shape [T, C, 3], found [8, 4]",
        ),
        ({"controller_points": np.zeros((8, 4, 2))}, "controller_points: expected shape [T, C, 3], found"),
        ({"controller_points": np.array(1.0)}, "controller_points: expected shape [T, C, 3], found []"),
        ({"object_visibilities": np.ones((FRAMES, 2))}, "object_visibilities: expected shape [8, 5]"),
        (
            {"object_visibilities": np.zeros((1, POINTS))},
            "object_visibilities: expected shape [8, 5], found [1",
        ),
        ({"object_motions_valid": np.ones((3, POINTS))}, "object_motions_valid: expected shape [8, 5]"),
        (
            {"object_visibilities": np.full((FRAMES, POINTS), np.nan)},
            "object_visibilities: expected true or false, found NaN",
        ),
        ({"object_colors": np.ones((2, 3))}, "object_colors: expected shape [T, 5, 3], found [2, 3]"),
        ({"object_points": np.zeros((0, POINTS, 3))}, "times: expected at least 2 frames, found 0"),
        ({"object_points": case()["object_points"] * 1000}, "points: expected an object of 0.001 to 10 m"),
    ],
)
def test_refuses(tmp_path: Path, changes: dict[str, object], expected: str):
    with pytest.raises(InputError) as caught:
        observe_phystwin(save(tmp_path, **changes))
    assert str(caught.value).startswith(f"final_data.pkl: {expected}")


def test_frames_that_only_the_hand_or_the_object_has_are_left_out_and_said(tmp_path: Path):
    with pytest.warns(UserWarning, match="8 frames of the object and 6 of the hand: the first 6 are taken"):
        observation = observe_phystwin(save(tmp_path, controller_points=case()["controller_points"][:6]))
    assert len(observation.times) == len(observation.points) == len(observation.controllers) == 6


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "o.npz"
    assert main(["observe", str(save(tmp_path)), "--out", str(out), "--fps", "60", "--quiet"]) == 0
    assert read_observation_quietly(out).times[-1] == pytest.approx((FRAMES - 1) / 60)
    (tmp_path / "clip.mp4").write_bytes(b"x")
    out.unlink()
    wish = ["observe", str(save(tmp_path)), "--out", str(out), "--box", "1,2,3,4", "--tracking", "opencv"]
    assert main(wish) == 2
    assert capsys.readouterr().err == (
        "matphys: --box, --tracking: only for a clip with its --twin, not for final_data.pkl\n"
    )
    assert not out.exists()
    assert main(["observe", str(tmp_path / "clip.mp4"), "--out", str(out)]) == 2
    assert "or a clip with its --twin" in capsys.readouterr().err
    assert main(["observe", str(save(tmp_path)), "--out", str(out), "--fps", "0"]) == 2
    assert "expected more than 0" in capsys.readouterr().err


def read_observation_quietly(path: Path):
    with pytest.warns(UserWarning, match="too short"):
        return read_observation(path)
