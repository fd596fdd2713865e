"""From probabilities to a verdict: doubts, look-alikes, a second effect."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.classifier import CLASSES
from model.gap.signs import signs_of
from model.gap.verdict import (
    ASTRAY,
    BEYOND,
    FURTHER,
    LIMITS,
    MOST,
    STEP,
    UNTRIED,
    USUAL,
    Judged,
    alike,
    isolability,
    second_of,
    support,
)

SIZE = 400


def said(**chances):
    """Of these, the rest shared alike by all others."""
    rest = (1.0 - sum(chances.values())) / (len(CLASSES) - len(chances))
    return Judged({name: chances.get(name, rest) for name in CLASSES})


@pytest.fixture
def ways():
    """The tilt is the wind once stiffness has followed; damage is something else."""
    rng = np.random.default_rng(7)
    twin, wind, damage, slip = rng.normal(size=(4, SIZE))
    return {
        "twin": ("twin", {"stiffness": 0.0}, twin),
        "wind": ("wind", {"x": 1.0}, wind + 30.0 * twin),
        "gravity_tilt": ("gravity_tilt", {"about_x": 1.0}, -2.0 * wind + 0.1 * rng.normal(size=SIZE)),
        "damage": ("damage", {"rate": 1.0}, damage),
        "grip_slip": ("grip_slip", {"slip": 1.0}, slip),
    }


@pytest.fixture
def two(made, ways, evened):
    """Wind and damage are at work together."""
    wind = ways["wind"][2] - 30.0 * ways["twin"][2]
    plain = np.random.default_rng(8).normal(size=SIZE) - 2.0 * wind - 1.0 * ways["damage"][2]
    return made(list(ways.values()), evened(plain))


def test_the_best_is_the_likeliest():
    judged = said(wind=0.5, none=0.3, damage=0.1)
    assert (judged.best, judged.effect) == ("wind", "wind")
    assert judged.ranked[:2] == ("wind", "damage")
    assert len(judged.ranked) == len(CLASSES) - 2


@pytest.mark.parametrize("answer", ["none", "unknown"])
def test_none_and_unknown_name_no_effect(answer):
    judged = said(**{answer: 0.5, "wind": 0.4})
    assert (judged.best, judged.effect) == (answer, None)
    assert judged.ranked[0] == "wind"


def test_look_alikes_have_the_same_signature_beside_the_twins_own_parameters(two):
    signs = signs_of(two, "sheet", 2.0, False)
    assert alike(two, signs, "wind") == ("gravity_tilt",)
    assert alike(two, signs, "gravity_tilt") == ("wind",)
    assert alike(two, signs, "damage") == ()
    assert alike(two, signs, "adhesion") == ()


def test_isolability_is_the_cosine_of_what_projections_leave(two, ways):
    signs = signs_of(two, "sheet", 2.0, False)
    found = isolability(two, signs)
    twin = ways["twin"][2]
    left = [ways[name][2] - twin * (twin @ ways[name][2]) / (twin @ twin) for name in signs.names]
    left = np.stack([each / np.linalg.norm(each) for each in left])
    np.testing.assert_allclose(found, left @ left.T, atol=2e-3)
    np.testing.assert_allclose(np.diag(found), 1.0)


def test_a_second_effect_explains_what_the_first_leaves(two):
    signs = signs_of(two, "sheet", 2.0, False)
    assert second_of(said(wind=0.6, damage=0.3), signs, two) == "damage"


def test_a_look_alike_is_no_second_effect_but_the_next_may_be(two):
    signs = signs_of(two, "sheet", 2.0, False)
    judged = said(wind=0.4, gravity_tilt=0.3, damage=0.2)
    assert second_of(judged, signs, two) == "damage"


def test_there_is_no_second_that_is_unlikely_explains_nothing_or_cannot_act(two):
    signs = signs_of(two, "sheet", 2.0, False)
    assert second_of(said(wind=0.9, damage=0.09), signs, two) is None
    assert second_of(said(wind=0.5, grip_slip=0.4), signs, two) is None
    assert second_of(said(adhesion=0.6, damage=0.3), signs, two) is None
    alone = replace(
        signs, names=("wind",), each=signs.each[-1:], probe=signs.probe[-1:], scale=signs.scale[-1:]
    )
    assert second_of(said(wind=0.5, damage=0.4), alone, two) is None


def test_support_is_what_all_parts_lose_however_much_there_was():
    halved = support((40.0, 20.0), (2.0, 1.0))
    assert halved == pytest.approx(2.0 * np.log(2.0))
    assert support((40.0, 20.0), (1.0, 2.0)) == pytest.approx(0.0)
    assert support((40.0, 20.0), (1.0, 0.5), (9.0, 3.0)) == pytest.approx(halved + np.log(3.0))
    assert support((40.0, 20.0)) == pytest.approx(np.log(2.0))
    # one recording in which a twin goes astray, or fits all too well, does not decide alone
    assert support((4.0, 1.0), (1.0, 1e9)) == pytest.approx(MOST[0] + np.log(4.0))
    assert support((1.0, 0.0), (1.0, 0.0)) == 2.0 * MOST[1]


def test_what_the_fitted_frames_hardly_show_others_do_not_decide():
    faint = np.exp(0.04)
    assert support((faint, 1.0), (2.0, 1.0)) == pytest.approx((1.0 + BEYOND) * 0.04)
    assert support((1.0, 1.0), (9.0, 1.0)) == 0.0
    assert support((1.0, faint), (9.0, 1.0)) == pytest.approx(-0.04)


def test_what_the_other_interaction_confirms_is_believed_and_what_it_does_not_is_doubted():
    before = said(wind=0.2, damage=0.2, none=0.4)
    after = before.supported({"wind": USUAL["rope"] + 0.5, "damage": USUAL["rope"] - 0.5}, "rope")
    assert after.best == "wind"
    assert after.chances["damage"] < before.chances["damage"]
    assert sum(after.chances.values()) == pytest.approx(1.0)
    same = before.supported({"wind": USUAL["rope"]}, "rope")
    assert same.chances["wind"] / same.chances["none"] == pytest.approx(0.2 / 0.4)


def test_of_two_that_explain_much_the_one_that_explains_more_is_believed():
    before, most = said(wind=0.2, damage=0.2, none=0.4), USUAL["rope"] + LIMITS[1] * STEP
    after = before.supported({"wind": most + 3 * FURTHER, "damage": most}, "rope")
    assert after.chances["wind"] / after.chances["damage"] == pytest.approx(np.exp(3.0))
    assert after.chances["damage"] / after.chances["none"] == pytest.approx(0.5 * np.exp(LIMITS[1]))


def test_effects_that_were_not_worth_a_fit_are_believed_as_little_as_those_that_explain_nothing():
    before = said(wind=0.2, damage=0.1, none=0.4)
    after = before.supported({"wind": USUAL["rope"]}, "rope")
    assert after.chances["damage"] / after.chances["none"] == pytest.approx(np.exp(UNTRIED) * 0.1 / 0.4)
    assert after.chances["unknown"] / after.chances["none"] == pytest.approx(before.chances["unknown"] / 0.4)
    assert after.chances["damage"] == pytest.approx(
        before.supported({"wind": USUAL["rope"], "damage": 0.0}, "rope").chances["damage"]
    )
    assert before.supported({}, "rope").chances == pytest.approx(before.chances), "nothing was tried at all"


def test_slack_springs_have_to_explain_more_in_what_buckles():
    before, slack = said(tension_only=0.3, none=0.4), {"tension_only": 0.9}
    assert before.supported(slack, "solid").best == "tension_only"
    assert before.supported(slack, "sheet").best == "none"
    assert before.supported(slack, "rope").best == "none"


def test_what_the_twin_follows_in_no_recording_lacks_something_unknown():
    before = said(none=0.8, unknown=0.05, wind=0.1)
    lost = before.puzzled(0.2, 0.1)
    assert lost.best == "unknown"
    assert sum(lost.chances.values()) == pytest.approx(1.0)
    assert lost.chances["wind"] / lost.chances["none"] == pytest.approx(0.1 / 0.8)
    assert before.puzzled(0.1, ASTRAY, 0.2).chances == pytest.approx(before.chances)


def test_a_recording_that_the_twin_follows_tells_that_it_knows_enough():
    before = said(none=0.5, unknown=0.45)
    assert before.puzzled(0.3, 0.01).chances["unknown"] < 0.1


def test_an_effect_that_explains_it_is_named_all_the_same():
    before = said(none=0.7, unknown=0.05, wind=0.1)
    explained = before.supported({"wind": USUAL["solid"] + 1.0}, "solid")
    assert explained.puzzled(0.15, 0.15).best == "wind"
