import json
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from model.encoders.kinematic import KinematicEncoder
from model.errors import InputError
from model.predictor.datamodule import CaseDataModule, Draws, Look, Opinions
from model.predictor.motion_store import STORE, read_motion, store_motion
from model.scenes.files import describe, load_case, read_index, save_case, write_index


def test_draws_are_every_case_once_and_follow_from_seed_and_epoch():
    draws = Draws(20, Opinions(), seed=3)
    first = list(draws)
    draws.set_epoch(1)
    second = list(draws)
    assert sorted(look.index for look in first) == sorted(look.index for look in second) == list(range(20))
    assert [look.index for look in first] != [look.index for look in second]
    again = Draws(20, Opinions(), seed=3)
    again.set_epoch(1)
    assert list(again) == second
    assert {look.opinion for look in Draws(20, Opinions(0.0, 0.0, 1.0), seed=3)} == {"wrong"}


def test_processes_share_the_draws_evenly():
    ranks = [list(Draws(7, Opinions(), seed=0, rank=rank, ranks=2)) for rank in (0, 1)]
    assert [len(own) for own in ranks] == [4, 4]
    assert {look.index for own in ranks for look in own} == set(range(7))


@dataclass
class Place:
    global_rank: int
    world_size: int


def test_validation_has_every_case_under_every_opinion_the_same_in_every_run(case_folder):
    data = CaseDataModule(case_folder, validation_share=0.4, batch_size=2)
    data.prepare_data()
    data.setup("fit")
    looks = data.fixed_looks()
    assert sorted((look.index, look.opinion) for look in looks) == sorted(
        (index, opinion) for index in (0, 1) for opinion in ("right", "uniform", "wrong")
    )
    assert len({look.opinion for look in looks[:2]}) == 2
    batches = list(data.val_dataloader())
    assert [len(batch) for batch in batches] == [2, 2, 2]
    again = list(data.val_dataloader())
    torch.testing.assert_close(again[0].sample.distribution, batches[0].sample.distribution)
    seen = {example.case.object_name for batch in batches for example in batch.examples}
    trained = {example.case.object_name for batch in data.train_dataloader() for example in batch.examples}
    assert not seen & trained
    assert len(seen | trained) == 5
    stored = [example for batch in data.predict_dataloader() for example in batch.examples]
    assert all(example.opinion is None for example in stored)


def test_objects_that_are_there_already_and_are_not_those_asked_for_are_said(make_case, tmp_path):
    save_case(make_case(), tmp_path / "a.case.npz")
    write_index(tmp_path, 3)
    for objects, seed in ((2, 3), (300, 4)):
        data = CaseDataModule(tmp_path, objects=objects, seed=seed)
        with pytest.warns(UserWarning, match=f"has 1 objects of seed 3 already.*data.objects is {objects}"):
            data.prepare_data()
    write_index(tmp_path, None)
    CaseDataModule(tmp_path, objects=300).prepare_data()  # recordings: none can be made


def test_an_example_depends_on_its_look_alone(case_folder):
    data = CaseDataModule(case_folder, validation_share=0.4)
    data.prepare_data()
    data.setup("fit")
    dataset = data.train_dataloader().dataset
    look = Look(1, "wrong", (5, 0, 1))
    first, _, second = dataset[look], dataset[Look(0, "right", (1,))], dataset[look]
    for (name, one), (_, other) in zip(first.sample.tensors(), second.sample.tensors(), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0, msg=name)
    uniform = dataset[Look(1, "uniform", ())].sample.distribution
    np.testing.assert_allclose(uniform, 0.1)


def test_a_share_that_is_none_is_refused(case_folder):
    with pytest.raises(InputError, match="validation_share"):
        CaseDataModule(case_folder, validation_share=1.0)


class Counting(KinematicEncoder):
    """Counts how often it is asked."""

    name = "counting"
    asked = 0

    def forward(self, clip):
        type(self).asked += 1
        return super().forward(clip)


def test_motion_is_described_once_and_again_when_the_case_changes(make_case, tmp_path):
    path = tmp_path / "one.case.npz"
    save_case(make_case(seed=1, frames=8), path)
    Counting.asked = 0
    for _ in range(2):
        store_motion([path], Counting())
    assert Counting.asked == 1
    first = read_motion(path, Counting())
    assert first.points.shape == (72, Counting().dim)
    save_case(make_case(seed=2, frames=8), path)
    store_motion([path], Counting())
    assert Counting.asked == 2
    assert not np.array_equal(read_motion(path, Counting()).whole, first.whole)


def test_motion_that_was_damaged_is_named_with_what_to_do(make_case, tmp_path):
    path = tmp_path / "one.case.npz"
    save_case(make_case(seed=1, frames=8), path)
    store_motion([path], Counting())
    (kept,) = (tmp_path / "motion").rglob("*.npz")
    kept.write_bytes(b"nonsense")
    with pytest.raises(InputError, match=f"{re.escape(str(kept))}: .* delete it"):
        read_motion(path, Counting())


def test_motion_of_the_frames_from_the_split_on_is_not_described(make_case, tmp_path):
    from model.predictor.motion_store import describe_case

    case = make_case(frames=12)
    spoilt = case.observation.points.copy()
    spoilt[case.split :] = 7.0
    other = replace(case, observation=replace(case.observation, points=spoilt))
    found = [describe_case(one, KinematicEncoder()) for one in (case, other)]
    np.testing.assert_array_equal(found[0].points, found[1].points)
    np.testing.assert_array_equal(found[0].whole, found[1].whole)


def test_several_processes_describe_what_one_does(case_folder, tmp_path):
    encoder, paths = KinematicEncoder(), []
    for path in read_index(case_folder)[:2]:
        paths.append(tmp_path / path.name)
        save_case(load_case(path), paths[-1])
    reports = []
    store_motion(paths, encoder, workers=2, progress=lambda stage, share: reports.append(share))
    assert reports == [0.5, 1.0]
    found = [read_motion(path, encoder) for path in paths]
    for kept in (tmp_path / STORE).rglob("*.npz"):
        kept.unlink()
    store_motion(paths, encoder)
    for one, path in zip(found, paths, strict=True):
        np.testing.assert_allclose(one.points, read_motion(path, encoder).points, atol=1e-5)


def test_a_fold_is_left_out_of_training_and_validation_and_is_tested(case_folder):
    everything, apart = {entry.object_name for entry in describe(case_folder).cases}, set[str]()
    for fold in range(5):
        data = CaseDataModule(case_folder, validation_share=0.4, folds=5, fold=fold)
        data.prepare_data()
        data.setup("fit")
        seen = {
            example.case.object_name
            for loader in (data.train_dataloader(), data.val_dataloader())
            for batch in loader
            for example in batch.examples
        }
        data.setup("test")
        tested = {e.case.object_name for batch in data.test_dataloader() for e in batch.examples}
        assert len(tested) == 1
        assert seen == everything - tested
        assert data.origin()["objects"] == 4
        assert json.loads(data.origin()["left out"]) == sorted(tested)
        apart |= tested
    assert apart == everything
    assert "left out" not in CaseDataModule(case_folder).origin()


def test_a_card_lists_who_is_known_unless_that_follows_from_the_seed(make_case, case_folder, tmp_path):
    listed = json.loads(CaseDataModule(case_folder).origin()["known"])
    assert sorted(listed) == sorted({entry.object_name for entry in describe(case_folder).cases})
    for number in range(2):
        case = replace(make_case(seed=number, frames=8), name=f"c{number}", object_name=f"rope-4-000{number}")
        save_case(case, tmp_path / f"{case.name}.case.npz")
    write_index(tmp_path, seed=4)
    assert "known" not in CaseDataModule(tmp_path).origin()
    (tmp_path / "c0.case.npz").unlink()
    write_index(tmp_path, seed=4)
    assert CaseDataModule(tmp_path).origin()["known"] == '["rope-4-0001"]'
