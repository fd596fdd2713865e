"""Names and numbers as people read them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from model.gap.report.wording import listed, millimetres, number, percent, percent_range, plain, quantity


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.03141, "0.0314"),
        (21.0, "21"),
        (-2.5, "−2.5"),
        (123456.0, "123000"),
        (1.2e-5, "1.2e−5"),
        (2e7, "2e7"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


@given(st.floats(-1e12, 1e12).filter(lambda value: value == 0 or abs(value) > 1e-12))
def test_numbers_are_right_to_three_digits(value):
    assert math.isclose(float(number(value).replace("−", "-")), value, rel_tol=5.1e-3)


@pytest.mark.parametrize(
    ("metres", "text"), [(0.0214, "21.4 mm"), (0.00052, "0.52 mm"), (0.4, "400 mm"), (0.0, "0.00 mm")]
)
def test_distances_are_in_millimetres(metres, text):
    assert millimetres(metres) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.853, "85 %"),
        (0.004, "< 1 %"),
        (0.9991, "> 99 %"),
        (0.0, "0 %"),
        (1.0, "100 %"),
        (-0.2, "−20 %"),
        (-0.0007, "0 %"),
    ],
)
def test_what_is_neither_nothing_nor_all_is_not_shown_as_such(share, text):
    assert percent(share) == text


def test_ranges():
    assert percent_range((0.81, 0.88)) == "81–88 %"
    assert percent_range((-0.1, 0.3)) == "−10 to 30 %"
    assert percent_range((-0.001, 0.3)) == "0–30 %"


def test_words():
    assert plain("quadratic_air_drag") == "quadratic air drag"
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c"], "or") == "a, b or c"
    assert quantity(0.5, "1") == "0.5"
    assert quantity(0.5, "m/s") == "0.5 m/s"
