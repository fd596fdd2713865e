"""A clip is fitted once by each method, however many lead what it made."""

import time

import pytest

from model.evaluation.baselines import HoldLast, PriorMean
from model.evaluation.fits import Fits, fitter
from model.evaluation.hidden import seen_until_split
from model.evaluation.protocol import SETTINGS
from model.evaluation.run import Plan, evaluate
from model.evaluation.synchronised import Led, Synchronised


class Counting(PriorMean):
    """Says how often it was asked, and takes its time."""

    fits = 0

    def fit(self, case):
        Counting.fits += 1
        time.sleep(0.02)
        return super().fit(case)


class Broken(HoldLast):
    fits = 0

    def fit(self, case):
        Broken.fits += 1
        raise ValueError("no idea")


@pytest.fixture
def shown(make_case):
    return seen_until_split(make_case())


@pytest.fixture(autouse=True)
def uncounted():
    Counting.fits = Broken.fits = 0


@pytest.mark.parametrize("led_first", [False, True])
def test_who_leads_it_does_not_fit_again(shown, led_first):
    fits = Fits()
    order = [Counting(), Synchronised(Counting())]
    free, led = (fits.of(method, shown) for method in (order[::-1] if led_first else order))
    if led_first:
        free, led = led, free
    assert Counting.fits == 1
    assert isinstance(led.fitted, Led)
    assert led.fitted.twin is free.fitted
    assert led.seconds == free.seconds > 0.01


def test_what_cannot_be_made_is_not_tried_again(shown):
    fits = Fits()
    for method in (Broken(), Synchronised(Broken()), Broken()):
        made = fits.of(method, shown)
        assert made.fitted is None
        assert made.failure == "ValueError: no idea"
    assert Broken.fits == 1


def test_what_cannot_be_led_is_a_failure(shown):
    made = Fits().of(Synchronised(HoldLast()), shown)
    assert made.fitted is None
    assert made.failure is not None
    assert "no springs and masses to lead" in made.failure


def test_methods_are_told_apart_by_who_fits():
    assert fitter(Synchronised(PriorMean())) == fitter(PriorMean()) != fitter(HoldLast())


def test_an_evaluation_fits_once_for_both(case_folder, tmp_path):
    methods = {"free": Counting(), "held": HoldLast(), "led": Synchronised(Counting())}
    records = evaluate(Plan(case_folder, methods, SETTINGS, pictures=False), tmp_path)
    assert Counting.fits == 2, "one for each clip"
    assert [record.method for record in records] == ["free", "held", "led"] * 2
    for free, _, led in (records[:3], records[3:]):
        assert led.fit_seconds == free.fit_seconds
        assert led.parts == free.parts
        assert led.reconstruction == free.reconstruction
