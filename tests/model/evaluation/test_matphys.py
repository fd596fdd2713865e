from dataclasses import replace

import numpy as np
import pytest
import torch

from model.encoders import KinematicEncoder
from model.errors import InputError
from model.evaluation.matphys import MatPhysMethod
from model.evaluation.protocol import Task, judge
from model.predictor.checkpoint import About, load_predictor, names_text, save_predictor
from model.predictor.options import NetworkOptions


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """A predictor that was trained on nothing."""
    torch.manual_seed(0)
    encoder, options = KinematicEncoder(), NetworkOptions(dim=16, layers=1, heads=2)
    path = tmp_path_factory.mktemp("predictor") / "untrained.safetensors"
    about = About(
        schema="matphys.predictor/1",
        options=options.as_dict(),
        motion_dim=encoder.dim,
        motion_global_dim=encoder.global_dim,
        encoder=encoder.name,
        encoder_version=encoder.version,
        data={"index": "a" * 64},
    )
    save_predictor(path, options.build(encoder.dim, encoder.global_dim), about)
    return path


def task(checkpoint, case, *others, source=None):
    method = MatPhysMethod(checkpoint)
    return Task(key="k", name="ours", method=method, case=case, own=case, others=others, source=source)


def test_it_is_measured_as_any_other_method(checkpoint, object_cases):
    record = judge(task(checkpoint, *object_cases(0)))
    assert record.failed is None
    assert record.unseen[0].failed is None
    assert record.method == "ours"
    assert record.future["track"] > 0.0
    # an untrained network stays near the prior, and says how unsure it is
    for part in record.parts:
        assert abs(part.log_estimate - part.log_truth) < 5.0
        assert part.log_spread > 0.0
    assert set(record.globals) == {"dashpot_damping", "drag_rate", "friction", "restitution"}


def test_what_it_was_not_shown_changes_nothing(checkpoint, object_cases):
    case = object_cases(0)[0]
    points = case.observation.points.copy()
    points[case.split :] += 1.0
    other = replace(case, observation=replace(case.observation, points=points), complete=case.complete + 1.0)
    first, second = (judge(task(checkpoint, one)) for one in (case, other))
    assert [part.log_estimate for part in first.parts] == [part.log_estimate for part in second.parts]
    np.testing.assert_allclose(second.future["track"], np.sqrt(3.0), atol=0.5)


def test_an_object_it_was_trained_on_is_known(checkpoint, object_cases):
    case = object_cases(0)[0]
    assert judge(task(checkpoint, case, source="a" * 64)).known_object
    assert not judge(task(checkpoint, case, source="b" * 64)).known_object
    assert not judge(task(checkpoint, case)).known_object


@pytest.mark.parametrize(
    ("told", "known", "unknown"),
    [
        # a part of the training's folder, or one generated again: another index, the same names
        ({"seed": 3, "objects": 24}, ["foam-3-0000", "rope-3-0023"], ["rope-3-0024", "foam-4-0000", "bar-3"]),
        # of three objects the second was left out
        (
            {"seed": 3, "objects": 2, "left out": "foam-3-0001"},
            ["foam-3-0002"],
            ["foam-3-0001", "bag-3-0003"],
        ),
        # objects that do not follow from a seed
        ({"seed": 3, "objects": 2, "known": "foam-3-0100 bar-7"}, ["foam-3-0100", "bar-7"], ["foam-3-0000"]),
        ({"seed": None, "objects": 24}, [], ["foam-0-0000", "bar-7"]),
        # another recording of a thing that was trained on, or left out
        (
            {"seed": None, "known": "single_lift_sloth cup_1", "left out": "single_lift_rope"},
            ["double_lift_sloth", "cup_1"],
            ["single_push_rope_4", "cup_2"],
        ),
        # names with spaces
        (
            {"known": names_text(["red mug", "blue bear"]), "left out": names_text(["old sock"])},
            ["red mug", "blue bear"],
            ["red", "mug blue", "old sock"],
        ),
    ],
)
def test_objects_are_known_wherever_they_lie(told, known, unknown, checkpoint, tmp_path):
    trained = load_predictor(checkpoint)
    about = trained.about.model_copy(update={"data": {"index": "a" * 64} | told})
    save_predictor(tmp_path / "told.safetensors", trained.network, about)
    method = MatPhysMethod(tmp_path / "told.safetensors")
    for name in known:
        assert method.knew("b" * 64, name), name
    for name in unknown:
        assert not method.knew("b" * 64, name), name


def test_of_a_folder_the_predictor_is_asked_that_left_the_object_out(checkpoint, object_cases, tmp_path):
    known, cases = load_predictor(checkpoint), [object_cases(seed)[0] for seed in (0, 1, 2)]
    for number, case in enumerate(cases[:2]):
        told = known.about.data | {"left out": f"somebody {case.object_name}"}
        about = known.about.model_copy(update={"data": told})
        save_predictor(tmp_path / f"{number}.safetensors", known.network, about)
    method = MatPhysMethod(tmp_path)
    assert not method.knew("a" * 64, cases[0].object_name)
    assert MatPhysMethod(tmp_path / "0.safetensors").knew("a" * 64, cases[1].object_name)
    assert not MatPhysMethod(tmp_path / "0.safetensors").knew("a" * 64, cases[0].object_name)
    assert method.fit(cases[1]).part_belief is not None
    with pytest.raises(InputError, match=f"left out {cases[2].object_name}"):
        method.fit(cases[2])
    before = method.identity()
    (tmp_path / "1.safetensors").unlink()
    assert MatPhysMethod(tmp_path).identity() != before


def test_other_weights_are_another_result(checkpoint, tmp_path):
    copy = tmp_path / "copy.safetensors"
    copy.write_bytes(checkpoint.read_bytes())
    assert MatPhysMethod(copy).identity() == MatPhysMethod(checkpoint).identity()
    known = load_predictor(checkpoint)
    save_predictor(copy, known.network, known.about.model_copy(update={"config": "another"}))
    assert MatPhysMethod(copy).identity() != MatPhysMethod(checkpoint).identity()


def test_a_predictor_that_looks_at_pictures_is_refused_before_anything_is_measured(checkpoint, tmp_path):
    known, path = load_predictor(checkpoint), tmp_path / "films.safetensors"
    save_predictor(path, known.network, known.about.model_copy(update={"encoder": "videomae"}))
    for given in (path, tmp_path):
        with pytest.raises(InputError, match=r"films\.safetensors: its motion encoder videomae") as refused:
            MatPhysMethod(given)
        assert "\n" not in str(refused.value)


def test_a_predictor_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such predictor"):
        MatPhysMethod(tmp_path / "none.safetensors")
