"""Cases that somebody else wrote: what does not fit is refused where it is read, in one line."""

from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.scenes.case_archive import CaseText, assemble, case_arrays, case_text


def _again(case, change=lambda arrays, text: None):
    arrays, text = case_arrays(case), case_text(case)
    change(arrays, text)
    return assemble(CaseText.model_validate(text), arrays, "a.case.npz")


def _array(name, value):
    def change(arrays, text):
        arrays[name] = value(arrays[name])

    return change


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("topology.mass", lambda a: a[:-1], r"topology\.mass: expected shape \[\d+\], found \[\d+\]"),
        ("topology.mass", lambda a: -a, r"topology\.mass: expected more than 0"),
        ("topology.points", lambda a: a * np.nan, r"topology\.points: expected finite numbers"),
        ("topology.points", lambda a: a.ravel(), r"topology\.points: expected shape \[P, 3\]"),
        ("topology.part", lambda a: a[:0], r"topology\.part: expected shape"),
        ("topology.part", lambda a: a - 1, r"topology\.part: expected indices below 2, found -1 to 0"),
        ("topology.rest_length", lambda a: 0 * a, r"topology\.rest_length: expected more than 0, found 0"),
        ("topology.controller_springs", lambda a: a.ravel(), r"topology\.controller_springs: expected shape"),
        (
            "topology.controller_springs",
            lambda a: a + np.array([99, 0]),
            r"controller_springs\[:, 0\]: expected indices",
        ),
        ("anchors.weight", lambda a: a[:, :-1], r"anchors\.weight: expected shape"),
        (
            "topology.springs",
            lambda a: a[:, [0, 0]],
            r"springs: expected two points each, found one twice in spring 0",
        ),
        (
            "anchors.weight",
            lambda a: 2 * a,
            r"anchors\.weight: expected rows that sum to 1, found 2 in row 0",
        ),
        ("complete", lambda a: a[:-1], r"complete: expected shape"),
        ("truth.modulus", lambda a: a[:-1], r"truth\.modulus: expected shape \[2\], found \[1\]"),
        ("truth.material", lambda a: a + 10, r"truth\.material: expected indices below 10"),
    ],
)
def test_arrays_that_do_not_fit_are_named(make_case, name, value, says):
    with pytest.raises(InputError, match=says):
        _again(make_case(frames=4), _array(name, value))


def test_a_body_without_springs_is_refused(make_case):
    def bare(arrays, text):
        for name in ("topology.springs", "topology.rest_length"):
            arrays[name] = arrays[name][:0]

    with pytest.raises(InputError, match=r"topology\.springs: expected at least one spring, found none"):
        _again(make_case(frames=4), bare)


@pytest.mark.parametrize(
    ("counted", "says"),
    [
        (("topology.points", "topology.mass", "topology.part"), "topology.points"),
        (("topology.controller_points", "observation.controllers"), "topology.controller_points"),
    ],
)
def test_indices_of_what_is_missing_are_no_error_of_ours(make_case, counted, says):
    """Nothing is left that says how many points, or controllers, there are."""

    def without(arrays, text):
        for name in counted:
            del arrays[name]

    with pytest.raises(InputError, match=f"expected the array {says}, found none"):
        _again(make_case(frames=4), without)


def test_gaps_are_no_damage(make_case):
    case = make_case(frames=4)
    case.observation.points[2, 3] = np.nan
    assert case.complete is not None
    case.complete[3, 1] = np.nan
    assert np.isnan(_again(case).complete[3, 1]).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"properties": {}}, "expected the properties damping, density"),
        ({"mean": -1.0}, "stiffness: expected a median above 0"),
        ({"restitution": 1.0}, "restitution: expected a median below 1, found 1"),
        ({"distribution": np.zeros(10)}, "expected shares that sum to 1, found 0"),
    ],
)
def test_a_belief_that_is_none_is_refused(make_case, change, says):
    case = make_case(frames=4)
    first, *others = case.priors
    if "restitution" in change:
        wrong = replace(first.properties["restitution"], mean=change["restitution"])
        change = {"properties": {**first.properties, "restitution": wrong}}
    if "mean" in change:
        wrong = replace(first.properties["stiffness"], **change)
        change = {"properties": {**first.properties, "stiffness": wrong}}
    with pytest.raises(InputError, match=says):
        _again(replace(case, priors=(replace(first, **change), *others)))


@pytest.mark.parametrize("name", ["../evil", "a\\b", ""])
def test_a_name_that_is_no_name_of_a_file_is_refused(make_case, name):
    with pytest.raises(ValueError, match="name"):
        _again(make_case(frames=4), lambda arrays, text: text.update(name=name))


def test_a_truth_that_lacks_something_is_refused(make_case):
    with pytest.raises(ValueError, match="friction"):
        _again(make_case(frames=4), lambda arrays, text: text["truth"].pop("friction"))
