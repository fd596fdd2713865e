import json
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.predictor.prior_mean import PriorMeanPredictor
from model.scenes.phystwin_case import read_phystwin_case, read_split
from model.scenes.replay import replay
from model.types import MaterialPrior, PartView

FRAMES, SIDE = 10, 0.012
"""Of the recording, and of a cube of its block [m] (`save_phystwin`)."""


def test_the_body_stands_upright_on_the_table_and_is_held(tmp_path, save_phystwin):
    split = {"frame_len": 8, "train": [0, 5], "test": [5, 8]}
    case = read_phystwin_case(save_phystwin(tmp_path, split=split), point_count=120)
    assert (case.name, case.object_class, case.shape_class) == ("single_lift_sloth", "plush", "solid")
    assert case.interaction == "lift"
    assert case.split == 5
    assert len(case.observation.times) == len(case.observation.points) == 8
    topology = case.topology
    assert len(topology.points) == 120
    low, high = topology.points.min(axis=0), topology.points.max(axis=0)
    assert 0 <= low[2] < 0.01
    assert 0.035 < high[2] < 4 * SIDE
    # Surface, tracked and interior points all belong to the body.
    assert case.gaussians is not None
    assert len(case.gaussians) == 240
    assert case.gaussians.volumes.sum() == pytest.approx(240 * SIDE**3, rel=0.35)
    np.testing.assert_allclose(case.gaussians.colors[0], [0.2, 0.4, 0.8], atol=0.01)
    assert case.observation.controllers.shape == (8, 4, 3)
    assert set(topology.controller_springs[:, 0]) == {0, 1, 2, 3}
    assert (case.rest[:, 2] > 2.9 * SIDE).all()
    assert case.complete is None
    assert case.truth is None
    np.testing.assert_allclose(
        case.observation.points[:, 0, 2] - case.rest[0, 2], 0.002 * np.arange(8), atol=1e-6
    )


def test_it_replays_with_the_means_of_its_prior(tmp_path, save_phystwin):
    case = read_phystwin_case(save_phystwin(tmp_path), point_count=80, observed=20)
    assert case.rest.shape == (20, 3)
    gravity = case.observation.gravity
    parameters = PriorMeanPredictor().from_priors(case.topology, case.priors, case.shape_class, gravity, 0.0)
    moved = replay(case, parameters, 4)
    np.testing.assert_allclose(moved[0], case.rest, atol=1e-5)
    assert np.isfinite(moved).all()


def test_points_that_were_not_tracked_well_are_gaps(tmp_path, save_phystwin):
    visible = np.ones((FRAMES, 60), bool)
    visible[3, 7] = False
    case = read_phystwin_case(
        save_phystwin(tmp_path, object_visibilities=visible), point_count=60, observed=60
    )
    np.testing.assert_array_equal(np.argwhere(np.isnan(case.observation.points[..., 0])), [[3, 7]])


def test_the_expert_sees_the_first_picture_without_the_hand(tmp_path, save_phystwin):
    folder = save_phystwin(tmp_path, "double_lift_cloth_3")
    for place in ("color/0", "mask/0/0", "mask/0/1"):
        (folder / place).mkdir(parents=True)
    cv2.imwrite(str(folder / "color/0/0.png"), np.full((8, 12, 3), (30, 20, 10), np.uint8))
    thing, hand = np.zeros((2, 8, 12), np.uint8)
    thing[:4], hand[6:] = 255, 255
    cv2.imwrite(str(folder / "mask/0/0/0.png"), thing)
    cv2.imwrite(str(folder / "mask/0/1/0.png"), hand)
    (folder / "mask" / "mask_info_0.json").write_text(json.dumps({"0": "cloth", "1": "hand"}))
    seen: list[PartView] = []

    class Expert:
        name, version, weights = "watching", "1", None

        def material(self, part: PartView) -> MaterialPrior:
            from model.priors.stub import StubPrior

            seen.append(part)
            return StubPrior().material(part)

    case = read_phystwin_case(folder, prior=Expert(), point_count=60)
    assert (case.object_class, case.shape_class, case.interaction) == ("cloth", "sheet", "double_lift")
    assert seen[0].shape_class == "sheet"
    np.testing.assert_array_equal(seen[0].image[0, 0], [10, 20, 30])
    np.testing.assert_array_equal(seen[0].mask, thing > 0)
    (folder / "mask" / "mask_info_0.json").write_text(json.dumps({"../../0": "cloth"}))
    with pytest.raises(InputError, match="names by number"):
        read_phystwin_case(folder)


@pytest.mark.parametrize(
    ("split", "expected"),
    [
        ({"train": [0, 7]}, "expected train and test"),
        ({"train": [1, 7], "test": [7, 10]}, r"expected train \[0, n\]"),
        ({"train": [0, 7], "test": [8, 10]}, r"expected train \[0, n\]"),
        ({"train": [0, 1], "test": [1, 10]}, r"2 <= n"),
        ({"train": [0, 12], "test": [12, 20]}, "before frame 10, found 12"),
        ([1, 2], "expected train and test"),
    ],
)
def test_a_split_that_is_none_is_refused(tmp_path, split, expected):
    path = tmp_path / "split.json"
    path.write_text(json.dumps(split))
    with pytest.raises(InputError, match=expected):
        read_split(path, 10)


def test_without_a_split_seven_frames_of_ten_are_learned_from(tmp_path):
    assert read_split(tmp_path / "split.json", 10) == (10, 7)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"object_points": None}, "object_points: expected an array"),
        ({"surface_points": np.zeros((3, 2))}, r"surface_points: expected shape \[P, 3\]"),
        ({"object_points": np.full((FRAMES, 60, 3), np.nan)}, "points"),
    ],
)
def test_a_folder_that_is_no_case_is_refused_with_one_line(tmp_path, changes, expected, save_phystwin):
    with pytest.raises(InputError, match=expected) as refused:
        read_phystwin_case(save_phystwin(tmp_path, **changes))
    assert "\n" not in str(refused.value)


def test_a_pickle_with_code_in_it_is_refused(tmp_path):
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "final_data.pkl").write_bytes(pickle.dumps({"object_points": Path("x")}))
    with pytest.raises(InputError, match="refused"):
        read_phystwin_case(folder)
