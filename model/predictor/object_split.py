"""Which objects are trained on, which judge the training, and which are left out of it altogether.

Recordings that may show the same thing (`object_group`) are one object here.
"""

from collections.abc import Sequence

import numpy as np

from model.errors import InputError
from model.scenes.case import ObjectClass
from model.scenes.files import IndexEntry
from model.scenes.object_group import object_group


def check_fold(folds: int, fold: int) -> None:
    """Refuse a fold that there is not.

    Raises:
        InputError: it is none of so many.
    """
    if (folds, fold) != (0, 0) and not (2 <= folds and 0 <= fold < folds):
        raise InputError(
            f"data.fold {fold} of data.folds {folds}: expected two folds or more, counted from 0"
        )


def left_out(entries: Sequence[IndexEntry], folds: int, fold: int, seed: int) -> list[str]:
    """Names of what is in one fold of several: every object is in one of them, every class in most.

    Args:
        entries: Of all cases.
        folds: How many; as many as there are objects: one object each; 0: nothing is left out.
        fold: Which, from 0 on.
        seed: Of who is with whom.

    Raises:
        InputError: there is no such fold, or it has no objects.
    """
    check_fold(folds, fold)
    if folds == 0:
        return []
    objects = _objects(entries)
    if len(objects) < folds:
        raise InputError(f"data.folds is {folds}, but there are {len(objects)} objects: give at most as many")
    drawn = np.random.default_rng(seed).permutation(sorted(objects)).tolist()
    by_class = sorted(drawn, key=objects.__getitem__)
    apart = set(by_class[fold::folds])
    return sorted({entry.object_name for entry in entries if object_group(entry.object_name) in apart})


def split_objects(
    entries: Sequence[IndexEntry], share: float, seed: int
) -> tuple[list[IndexEntry], list[IndexEntry]]:
    """Cases to train on and cases to hold out: of every class a share of the objects, no object in both.

    Raises:
        InputError: there are fewer than two objects.
    """
    objects = _objects(entries)
    held = set[str]()
    for kind in sorted(set(objects.values())):
        names = sorted(name for name, own in objects.items() if own == kind)
        count = min(max(1, round(share * len(names))), len(names) - 1)
        held.update(np.random.default_rng(seed).permutation(names)[:count].tolist())
    if len(objects) < 2:
        raise InputError(f"{len(objects)} objects: training needs at least 2, so that one can be held out")
    if not held:  # every class has but one object
        held.add(sorted(objects)[-1])
    return (
        [entry for entry in entries if object_group(entry.object_name) not in held],
        [entry for entry in entries if object_group(entry.object_name) in held],
    )


def _objects(entries: Sequence[IndexEntry]) -> dict[str, ObjectClass]:
    """Their classes, by group."""
    return {object_group(entry.object_name): entry.object_class for entry in entries}
