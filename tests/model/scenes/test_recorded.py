"""Recorded cases become a folder like generated ones, all or none."""

from pathlib import Path

import numpy as np
import pytest

from model.errors import InputError
from model.scenes.files import load_folder
from model.scenes.recorded import gather


def test_recordings_become_a_folder_of_cases(tmp_path, save_phystwin):
    recordings = [save_phystwin(tmp_path, name) for name in ("single_lift_sloth", "double_lift_cloth_1")]
    index = gather(tmp_path / "cases", recordings)
    assert [entry.object_name for entry in index.cases] == ["double_lift_cloth_1", "single_lift_sloth"]
    assert index.seed is None
    cloth, sloth = load_folder(tmp_path / "cases")
    assert (cloth.object_class, sloth.object_class) == ("cloth", "plush")
    assert sloth.truth is None


def test_one_that_is_refused_leaves_nothing(tmp_path, save_phystwin):
    good, bad = save_phystwin(tmp_path), save_phystwin(tmp_path, "broken_rope", object_points=None)
    with pytest.raises(InputError):
        gather(tmp_path / "cases", [good, bad])
    assert not (tmp_path / "cases").exists()


def test_two_of_one_name_are_refused(tmp_path, save_phystwin):
    (tmp_path / "other").mkdir()
    twice = [save_phystwin(tmp_path), save_phystwin(tmp_path / "other")]
    with pytest.raises(InputError, match="single_lift_sloth: two recordings have this name"):
        gather(tmp_path / "cases", twice)
    with pytest.raises(InputError, match="has cases already"):
        gather(tmp_path / "one", [twice[0]]) and gather(tmp_path / "one", [twice[1]])


def test_a_recording_that_is_refused_is_named(tmp_path, save_phystwin):
    good, bad = save_phystwin(tmp_path), save_phystwin(tmp_path, "broken_rope", object_points=None)
    with pytest.raises(InputError, match=r"broken_rope: final_data\.pkl: object_points"):
        gather(tmp_path / "cases", [good, bad])


@pytest.mark.parametrize("place", [".", "inner/.."])
def test_a_case_has_the_name_of_its_folder_however_that_is_written(
    tmp_path, save_phystwin, place, monkeypatch
):
    recording = save_phystwin(tmp_path)
    (recording / "inner").mkdir()
    monkeypatch.chdir(recording)
    index = gather(tmp_path / "cases", [Path(place)])
    assert [(entry.object_name, entry.interaction) for entry in index.cases] == [
        ("single_lift_sloth", "lift")
    ]


def test_a_hand_that_holds_nothing_is_told(tmp_path, save_phystwin):
    apart = np.full((10, 2, 3), [0.5, 0.5, -0.5])
    recording = save_phystwin(tmp_path, controller_points=apart)
    with pytest.warns(UserWarning, match=r"single_lift_sloth: 2 controller point.* hold nothing"):
        gather(tmp_path / "cases", [recording])
