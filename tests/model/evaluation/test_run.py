import hashlib

import pytest

from model.errors import InputError
from model.evaluation.baselines import HoldLast, PriorMean
from model.evaluation.protocol import SETTINGS
from model.evaluation.records import read_records
from model.evaluation.run import RESULTS, Plan, evaluate
from model.scenes.files import INDEX, save_case, write_index


class Counting(HoldLast):
    fits = 0

    def fit(self, case):
        Counting.fits += 1
        return super().fit(case)


@pytest.fixture
def plan(case_folder):
    Counting.fits = 0
    return Plan(case_folder, {"held": Counting(), "prior": PriorMean()}, SETTINGS, pictures=False)


def test_every_method_on_one_clip_of_every_object(plan, tmp_path):
    shares = []
    records = evaluate(plan, tmp_path, progress=lambda stage, share: shares.append(share))
    assert [(record.object_name, record.method) for record in records] == [
        ("bar-1", "held"),
        ("bar-1", "prior"),
        ("bar-0", "held"),
        ("bar-0", "prior"),
    ]
    assert shares == [0.25, 0.5, 0.75, 1.0]
    for record in records:
        assert {record.case, record.unseen[0].case} == {
            f"{record.object_name}-lift",
            f"{record.object_name}-push",
        }
        assert record.future["track"] > 0.0
    assert read_records(tmp_path / RESULTS) == records


def test_an_interrupted_evaluation_goes_on(plan, tmp_path):
    whole = evaluate(plan, tmp_path)
    results = tmp_path / RESULTS
    lines = results.read_bytes().splitlines(keepends=True)
    results.write_bytes(b"".join(lines[:2]) + lines[2][:40])
    Counting.fits = 0
    again = evaluate(plan, tmp_path)
    assert Counting.fits == 1  # of the two that were lost, one is its own
    assert [one.model_dump(exclude={"fit_seconds", "predict_seconds"}) for one in again] == [
        one.model_dump(exclude={"fit_seconds", "predict_seconds"}) for one in whole
    ]
    assert len(read_records(results)) == 4


def test_two_at_once_are_refused(plan, tmp_path):
    def again(stage, share):
        with pytest.raises(InputError, match="another evaluation is writing there: give another --out"):
            evaluate(plan, tmp_path)

    assert len(evaluate(plan, tmp_path, progress=again)) == 4
    assert len(read_records(tmp_path / RESULTS)) == 4


def test_what_failed_is_tried_again(plan, tmp_path):
    records = evaluate(plan, tmp_path)
    results = tmp_path / RESULTS
    results.write_text(results.read_text().replace('"failed": null', '"failed": "out of memory"', 1))
    Counting.fits = 0
    assert evaluate(plan, tmp_path)[0].failed is None
    assert Counting.fits == 1
    assert len(read_records(results)) == len(records)


class Remembering(HoldLast):
    """Knows the objects of folders with this index."""

    index = ""

    def knew(self, source, object_name):
        return source == self.index


def test_what_was_known_under_another_index_is_asked_again(object_cases, tmp_path):
    data, method = tmp_path / "data", Remembering()
    data.mkdir()
    save_case(object_cases(0)[0], data / "alone.case.npz")
    write_index(data)
    method.index = hashlib.sha256((data / INDEX).read_bytes()).hexdigest()
    plan = Plan(data, {"own": method}, ("future",), pictures=False)
    assert [record.known_object for record in evaluate(plan, tmp_path)] == [True]
    write_index(data, seed=5)
    assert [record.known_object for record in evaluate(plan, tmp_path)] == [False]


def test_other_priors_are_another_result(case_folder, tmp_path):
    def prior(opinion):
        plan = Plan(case_folder, {"prior": PriorMean()}, SETTINGS, opinion, pictures=False)
        return [record.parts[0].log_estimate for record in evaluate(plan, tmp_path)]

    right, uniform = prior("right"), prior("uniform")
    assert right != uniform
    assert prior("right") == right
    assert len(read_records(tmp_path / RESULTS)) == 4


def test_all_clips_may_be_learned_from(case_folder, tmp_path):
    plan = Plan(case_folder, {"held": HoldLast()}, ("future",), fits=5, pictures=False)
    records = evaluate(plan, tmp_path)
    assert len({record.case for record in records}) == 4
    assert all(record.unseen == [] for record in records)


def test_a_limit_takes_objects_of_all_classes(case_folder, tmp_path):
    plan = Plan(case_folder, {"held": HoldLast()}, ("future",), limit=1, pictures=False)
    assert [record.object_class for record in evaluate(plan, tmp_path)] == ["cloth"]


def test_several_processes_find_the_same(case_folder, tmp_path):
    plan = Plan(case_folder, {"held": HoldLast()}, SETTINGS, pictures=False)
    alone, beside = evaluate(plan, tmp_path / "one"), evaluate(plan, tmp_path / "two", workers=2)
    assert [record.future for record in alone] == [record.future for record in beside]


def test_a_folder_that_is_none(tmp_path):
    with pytest.raises(InputError, match=r"index\.json"):
        evaluate(Plan(tmp_path, {"held": HoldLast()}, SETTINGS), tmp_path / "out")


def test_one_interaction_is_not_enough_for_unseen_ones(object_cases, tmp_path):
    save_case(object_cases(0)[0], tmp_path / "alone.case.npz")
    write_index(tmp_path)
    with pytest.raises(InputError, match="leave that setting out"):
        evaluate(Plan(tmp_path, {"held": HoldLast()}, SETTINGS), tmp_path / "out")


def test_results_that_are_none(plan, tmp_path):
    (tmp_path / RESULTS).write_text('{"no": "record"}\n')
    with pytest.raises(InputError, match=r"results\.jsonl: a line is no record"):
        evaluate(plan, tmp_path)
