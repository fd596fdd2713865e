"""A jury learns to name effects from worlds whose effects are known, hand-made ones here."""

import numpy as np
import pytest

from model.gap import learn
from model.gap.classifier import CLASSES, NONE, UNKNOWN
from model.gap.learn import (
    ALARMS,
    calibrated,
    cautioned,
    folds,
    lesson_of,
    read_example,
    scores,
    target,
    train,
    with_caution,
    write_example,
)


def right(name):
    return np.eye(len(CLASSES))[CLASSES.index(name)]


def test_what_was_learned_names_effects_in_worlds_that_were_not_seen(worlds):
    examples = worlds(36)
    jury = train([lesson_of(example, i) for i, example in enumerate(examples)], jurors=2)
    others = worlds(24, seed=1)
    chances = jury.probabilities([example.signs() for example in others])
    found = scores(others, chances)
    assert found["top-1 of effects"] >= 0.9
    assert found["false alarms"] <= 0.2
    hidden = [example for example in others if example.effects]
    unnamed = jury.probabilities([example.signs(example.effects) for example in hidden])
    named = jury.probabilities([example.signs() for example in hidden])
    unknown = CLASSES.index(UNKNOWN)
    assert unnamed[:, unknown].mean() > named[:, unknown].mean() + 0.2


def test_the_same_seed_teaches_the_same(worlds):
    lessons = [lesson_of(example, i) for i, example in enumerate(worlds(6))]
    one, other = (train(lessons, seed=3, jurors=1).tensors() for _ in range(2))
    assert all((one[name] == other[name]).all() for name in one)


def test_what_is_right_to_say(worlds):
    sick, healthy = worlds(2)[1], worlds(1)[0]
    (name,) = sick.effects
    np.testing.assert_array_equal(target((), healthy.signs()), right(NONE))
    np.testing.assert_array_equal(target(sick.effects, sick.signs()), right(name))
    np.testing.assert_array_equal(target(sick.effects, sick.signs([name])), right(UNKNOWN))
    np.testing.assert_array_equal(target((UNKNOWN,), sick.signs()), right(UNKNOWN))
    both = target(("wind", "damage"), sick.signs())
    assert (both[CLASSES.index("wind")], both[CLASSES.index("damage")]) == (0.5, 0.5)


def test_lessons_hide_effects_at_work_and_say_unknown_then(worlds):
    lessons = [lesson_of(example, i) for i, example in enumerate(worlds(30))]
    unknown = 0
    for example, lesson in zip(worlds(30), lessons, strict=True):
        assert len(lesson.copies) == learn.COPIES
        assert lesson.copies[0][0] is lesson.plain
        for signs, wanted in lesson.copies:
            assert wanted.sum() == pytest.approx(1.0)
            np.testing.assert_array_equal(wanted, target(example.effects, signs))
            unknown += wanted[CLASSES.index(UNKNOWN)] == 1.0
    assert 0.08 < unknown / (30 * learn.COPIES) < 0.28


def test_a_world_in_which_only_the_effect_at_work_can_act_is_a_lesson_too(worlds):
    lesson = lesson_of(worlds(2, names=("wind",))[1], 0)
    assert {signs.names for signs, _ in lesson.copies} <= {("wind",), ()}


def test_an_example_comes_back_from_its_file(worlds, tmp_path):
    example = worlds(2)[1]
    write_example(tmp_path / "one.npz", example)
    again = read_example(tmp_path / "one.npz")
    assert again.evidence.columns == example.evidence.columns
    np.testing.assert_array_equal(again.evidence.grams, example.evidence.grams)
    np.testing.assert_array_equal(again.evidence.counts, example.evidence.counts)
    for field in ("shape", "cost", "ground", "effects", "group"):
        assert getattr(again, field) == getattr(example, field)
    assert [path.name for path in tmp_path.iterdir()] == ["one.npz"]


@pytest.mark.parametrize("count", [8, 21, 40])
def test_caution_accuses_few_healthy_twins(count):
    rng = np.random.default_rng(count)
    chances = rng.dirichlet(np.ones(len(CLASSES)), size=2 * count)
    none = CLASSES.index(NONE)
    targets = np.zeros_like(chances)
    targets[:count, none] = 1.0
    targets[count:, 0] = 1.0
    logs = np.log(chances)
    assert (logs[:count].argmax(1) != none).mean() > ALARMS
    logs[:, none] += cautioned(logs, targets)
    assert (logs[:count].argmax(1) != none).mean() <= ALARMS


def test_no_caution_where_no_healthy_twin_is_accused_or_there_is_none():
    logs = np.log(np.full((3, len(CLASSES)), 0.01))
    none = CLASSES.index(NONE)
    logs[:, none] = np.log(0.8)
    assert cautioned(logs, np.tile(right(NONE), (3, 1))) == 0.0
    assert cautioned(logs, np.tile(right("wind"), (3, 1))) == 0.0


def test_caution_for_a_part_is_learned_on_the_others():
    """The only healthy twin that is accused does not speak for itself."""
    rng = np.random.default_rng(0)
    chances = rng.dirichlet(np.ones(len(CLASSES)), size=10)
    none = CLASSES.index(NONE)
    chances[:9, none] = 5.0
    chances[9] = 0.01
    chances[9, 0] = 0.8
    chances /= chances.sum(1, keepdims=True)
    targets = np.tile(right(NONE), (10, 1))
    found = with_caution(chances, targets, [np.arange(9), np.array([9])])
    np.testing.assert_allclose(found[9], chances[9])
    assert (found[:9, none] > chances[:9, none]).all()
    np.testing.assert_allclose(found.sum(1), 1.0)


def test_calibration_softens_a_jury_that_is_too_sure(worlds):
    lessons = [lesson_of(example, i) for i, example in enumerate(worlds(4))]
    jury = train(lessons, jurors=1)
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 3, 200)
    said = np.where(rng.random(200) < 0.6, truth, (truth + 1) % 3)
    sure = np.full((200, len(CLASSES)), 0.01 / (len(CLASSES) - 1))
    sure[np.arange(200), said] = 0.99
    softened = calibrated(jury, sure, np.eye(len(CLASSES))[truth])
    assert float(softened.jurors[0].temperature) > 1.5
    assert float(softened.jurors[0].caution) == 0.0


def test_folds_are_all_worlds_once():
    parts = folds(13)
    assert sorted(np.concatenate(parts).tolist()) == list(range(13))
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_held_out_worlds_are_judged_by_a_jury_that_has_not_seen_them(worlds, monkeypatch):
    lessons = [lesson_of(example, i) for i, example in enumerate(worlds(6))]
    seen = []

    def remembering(some, seed=0, jurors=1):
        seen.append(list(some))
        return train(some, seed, 1)

    monkeypatch.setattr(learn, "train", remembering)
    monkeypatch.setattr(learn, "EPOCHS", 2)
    found = learn.cross_validated(lessons, [np.array([0, 1, 2]), np.array([3, 4, 5])])
    assert seen == [lessons[3:], lessons[:3]]
    np.testing.assert_allclose(found.sum(1), 1.0)


def test_scores_count_answers(worlds):
    examples = worlds(6)
    assert [bool(example.effects) for example in examples] == [False, True, True, False, True, True]
    answers = [NONE, *examples[1].effects, UNKNOWN, "wind", NONE, *examples[5].effects]
    found = scores(examples, 0.9 * np.stack([right(answer) for answer in answers]) + 0.1 / len(CLASSES))
    assert found["worlds"] == 6
    assert found["right"] == pytest.approx(3 / 6)
    assert found["top-1 of effects"] == pytest.approx(2 / 4)
    assert found["false alarms"] == pytest.approx(1 / 2)
    assert found["missed"] == pytest.approx(1 / 4)
