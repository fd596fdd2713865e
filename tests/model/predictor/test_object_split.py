import pytest

from model.errors import InputError
from model.predictor.object_split import left_out, split_objects
from model.scenes.files import IndexEntry


def entries(**classes):
    return [
        IndexEntry(
            file=f"{kind}-{number}-{act}.case.npz",
            sha256="",
            object_name=f"{kind}-{number}",
            object_class=kind,
            interaction=act,
        )
        for kind, count in classes.items()
        for number in range(count)
        for act in ("lift", "push", "drop")
    ]


def test_objects_are_split_not_cases_and_every_class_is_held_out():
    train, held = split_objects(entries(plush=10, rope=7, bag=2), 0.2, seed=0)
    names = [{entry.object_name for entry in part} for part in (train, held)]
    assert not names[0] & names[1]
    assert len(train) + len(held) == 57
    counts = {kind: sum(name.startswith(kind) for name in names[1]) for kind in ("plush", "rope", "bag")}
    assert counts == {"plush": 2, "rope": 1, "bag": 1}
    assert split_objects(entries(plush=10, rope=7, bag=2), 0.2, seed=0) == (train, held)
    assert split_objects(entries(plush=10, rope=7, bag=2), 0.2, seed=1) != (train, held)


def test_classes_of_one_object_each_still_leave_one_to_hold_out():
    train, held = split_objects(entries(plush=1, rope=1, bag=1), 0.2, seed=0)
    assert len({entry.object_name for entry in held}) == 1
    assert len({entry.object_name for entry in train}) == 2
    with pytest.raises(InputError, match="at least 2"):
        split_objects(entries(plush=1), 0.2, seed=0)


def test_every_object_is_left_out_once_and_folds_are_alike():
    cases = entries(plush=6, rope=5, bag=4)
    folds = [left_out(cases, 3, fold, seed=0) for fold in range(3)]
    assert [len(fold) for fold in folds] == [5, 5, 5]
    assert sorted(name for fold in folds for name in fold) == sorted({entry.object_name for entry in cases})
    for fold in folds:
        assert {name.split("-")[0] for name in fold} == {"plush", "rope", "bag"}
    assert left_out(cases, 3, 1, seed=0) == folds[1]
    assert left_out(cases, 3, 1, seed=1) != folds[1]
    assert [len(left_out(cases, 15, fold, seed=0)) for fold in range(15)] == [1] * 15
    assert left_out(cases, 0, 0, seed=0) == []


@pytest.mark.parametrize(
    ("folds", "fold", "says"),
    [(3, 3, "fold 3"), (3, -1, "fold -1"), (0, 1, "folds 0"), (1, 0, "two"), (9, 0, "8")],
)
def test_folds_that_cannot_be(folds, fold, says):
    with pytest.raises(InputError, match=says):
        left_out(entries(plush=4, rope=4), folds, fold, seed=0)


def test_recordings_of_one_thing_are_on_one_side():
    things = [
        *("single_lift_sloth", "double_lift_sloth", "single_push_sloth", "single_lift_zebra"),
        *("double_stretch_zebra", "single_lift_rope", "single_push_rope_1", "rope_double_hand"),
    ]
    cases = [
        IndexEntry(
            file=f"{name}.case.npz", sha256="", object_name=name, object_class=kind, interaction="lift"
        )
        for name in things
        for kind in (("rope",) if "rope" in name else ("plush",))
    ]
    groups = {"sloth": set(things[:3]), "zebra": set(things[3:5]), "rope": set(things[5:])}
    folds = [left_out(cases, 3, fold, seed=0) for fold in range(3)]
    assert sorted(map(sorted, folds)) == sorted(map(sorted, groups.values()))
    with pytest.raises(InputError, match="there are 3 objects"):
        left_out(cases, 4, 0, seed=0)
    for seed in range(6):
        train, held = split_objects(cases, 0.4, seed)
        sides = [{entry.object_name for entry in side} for side in (train, held)]
        assert all(any(group <= side for side in sides) for group in groups.values())
        assert sides[0]
        assert sides[1]
