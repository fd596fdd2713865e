"""From what fits explain to probabilities: a conditional logit, checked against its closed form."""

from dataclasses import fields, replace

import numpy as np
import pytest

from model.gap.account import Account, Explained
from model.gap.schema import EFFECT_NAMES
from model.gap.weighing import (
    ASTRAY,
    ASTRAY_STEP,
    HEALTHY,
    MOST_ASTRAY,
    MOST_BEYOND,
    SIMPLER,
    SLIGHT,
    Weighing,
)

WEIGHTS = Weighing(
    effect=-5.0,
    fitted=3.0,
    later=2.0,
    elsewhere=4.0,
    slowly=1.5,
    slowly_elsewhere=2.5,
    harm=5.0,
    sheet=-1.0,
    buckling=-4.0,
    unknown=-2.0,
    astray=1.0,
    left=1.0,
    flexible=1.5,
)
ALIKE = dict.fromkeys(EFFECT_NAMES, 1.0 / len(EFFECT_NAMES))


def usual(shape, beyond=0.0):
    """What is left of a healthy twin, or so many standard deviations more."""
    mean, spread = HEALTHY[shape]
    return float(np.exp(mean + beyond * spread))


def account(shape="rope", astray=(ASTRAY,), screened=ALIKE, left=None, **explained):
    return Account(shape, screened, explained, {}, astray, (usual(shape),) if left is None else left)


def odds(judged, one, other="none"):
    return np.log(judged.chances[one] / judged.chances[other])


def test_odds_are_the_weighed_sum_of_what_is_explained():
    judged = WEIGHTS.judged(account(wind=Explained(1.0, 0.5, 0.25), damage=Explained(0.2)))
    assert odds(judged, "wind") == pytest.approx(-5.0 + 3.0 + 1.0 + 1.0)
    assert odds(judged, "damage") == pytest.approx(-5.0 + 0.6)
    slow = WEIGHTS.judged(account(wind=Explained(1.0, slowly=2.0, slowly_elsewhere=-1.0)))
    assert odds(slow, "wind") == pytest.approx(-5.0 + 3.0 + 3.0 - 2.5)
    assert odds(judged, "unknown") == pytest.approx(-2.0)
    assert sum(judged.chances.values()) == pytest.approx(1.0)


def test_what_a_force_explains_and_no_effect_is_something_unknown():
    """By the share of it that none explains as well, here, whatever they explain elsewhere."""
    wind = {"wind": Explained(0.5, elsewhere=2.0, slowly=0.1), "damage": Explained(0.3)}
    asked = replace(account(**wind), flexible=Explained(1.2, 0.7, slowly=0.6))
    judged = WEIGHTS.judged(asked)
    assert odds(judged, "unknown") == pytest.approx(-2.0 + 1.5 * (1.2 - SLIGHT) / 1.8)
    assert odds(judged, "wind") == pytest.approx(-5.0 + 1.5 + 8.0 + 0.15)
    without = WEIGHTS.judged(account(**wind)).chances
    for force in (None, Explained(-0.3), Explained(0.6, 2.0), Explained(0.5, slowly=0.09 + SLIGHT)):
        assert WEIGHTS.judged(replace(asked, flexible=force)).chances == pytest.approx(without)


def test_what_does_harm_elsewhere_is_not_what_is_missing():
    helps, harms = Explained(1.0, 1.0, 0.2), Explained(1.0, 1.0, -0.2)
    judged = WEIGHTS.judged(account(wind=helps, damage=harms))
    assert odds(judged, "wind", "damage") == pytest.approx(4.0 * 0.4 + 5.0 * 0.2)


@pytest.mark.parametrize(("simple", "other"), [("gravity_tilt", "wind"), ("viscoelasticity", "plasticity")])
def test_the_simpler_of_two_is_likelier_where_it_explains_as_much(simple, other):
    """The other one can do what it does, with a quantity more; together they are believed as they were."""
    same = Explained(1.0, 0.5, 0.25)
    alone = WEIGHTS.judged(account(damage=same))
    judged = WEIGHTS.judged(account(**{other: same, simple: same, "damage": same}))
    assert odds(judged, simple, other) == pytest.approx(SIMPLER)
    assert SIMPLER == pytest.approx(0.5 * np.log(16))
    both = judged.chances[other] + judged.chances[simple]
    assert both == pytest.approx(2.0 * judged.chances["damage"])
    assert odds(judged, "damage") == pytest.approx(odds(alone, "damage"))
    more = WEIGHTS.judged(account(**{other: Explained(2.0, 1.0, 0.5), simple: same}))
    assert more.best == other


def test_a_tilt_that_was_not_fitted_takes_nothing_from_a_wind():
    judged = WEIGHTS.judged(account(wind=Explained(1.0)))
    assert odds(judged, "wind", "gravity_tilt") == pytest.approx(3.0)


def test_sheets_have_to_explain_more():
    wind = Explained(1.0, 0.5, 0.25, 0.5, 1.0)
    rope, sheet = (WEIGHTS.judged(account(shape, wind=wind)) for shape in ("rope", "sheet"))
    assert odds(rope, "wind") - odds(sheet, "wind") == pytest.approx(wind.total)


def test_slack_springs_have_to_explain_more_in_what_buckles():
    solid, sheet, rope = (
        WEIGHTS.judged(account(shape, tension_only=Explained(2.0))) for shape in ("solid", "sheet", "rope")
    )
    assert odds(solid, "tension_only") == pytest.approx(1.0)
    assert odds(rope, "tension_only") == pytest.approx(-3.0)
    assert odds(sheet, "tension_only") == pytest.approx(-5.0)


def test_effects_that_were_not_fitted_are_believed_as_little_as_those_that_explain_nothing():
    judged = WEIGHTS.judged(account(wind=Explained()))
    assert odds(judged, "damage") == pytest.approx(-5.0)
    assert odds(judged, "damage", "wind") == pytest.approx(0.0)
    assert odds(WEIGHTS.judged(account()), "damage") == pytest.approx(-5.0), "nothing was tried at all"


def test_these_share_what_is_left_to_them_as_score_tests_say():
    screened = ALIKE | {"damage": 0.4, "adhesion": 0.2}
    judged = WEIGHTS.judged(account(screened=screened, wind=Explained(3.0)))
    assert odds(judged, "damage", "adhesion") == pytest.approx(np.log(2.0))
    left = sum(judged.chances[name] for name in EFFECT_NAMES if name != "wind")
    assert left / judged.chances["none"] == pytest.approx((len(EFFECT_NAMES) - 1) * np.exp(-5.0))
    assert judged.ranked[:3] == ("wind", "damage", "adhesion")
    none_able = WEIGHTS.judged(account(screened=dict.fromkeys(EFFECT_NAMES, 0.0), wind=Explained(3.0)))
    assert none_able.best == "wind"


def test_what_cannot_act_is_never_the_answer():
    """Where all that can was fitted, and does harm, those that cannot would be the likelier effects."""
    able = {"wind": 0.6, "gravity_tilt": 0.4}
    screened = dict.fromkeys(EFFECT_NAMES, 5e-12) | able
    harm = dict.fromkeys(able, Explained(-1.0, -1.0, -1.0))
    judged = WEIGHTS.judged(account(screened=screened, left=(usual("rope", 9.0),), **harm))
    assert sum(judged.chances[name] for name in EFFECT_NAMES if name not in able) < 1e-6


def test_what_the_twin_follows_in_no_recording_lacks_something_unknown():
    far = ASTRAY + 3.0 * ASTRAY_STEP
    assert odds(WEIGHTS.judged(account(astray=(far, far + 0.1))), "unknown") == pytest.approx(1.0)
    assert WEIGHTS.judged(account(astray=(far + 0.1, far))).best == "unknown"
    followed = WEIGHTS.judged(account(astray=(far, ASTRAY)))
    assert odds(followed, "unknown") == pytest.approx(-2.0)
    assert odds(WEIGHTS.judged(account(astray=(9.0,))), "unknown") == pytest.approx(-2.0 + MOST_ASTRAY[1])


@pytest.mark.parametrize("shape", ["rope", "sheet", "solid"])
def test_a_twin_that_leaves_more_than_healthy_ones_do_lacks_something(shape):
    none = {
        more: WEIGHTS.judged(account(shape, left=(usual(shape, more),))).chances["none"]
        for more in (-9.0, MOST_BEYOND[0], 0.0, 2.0, MOST_BEYOND[1], 9.0)
    }
    assert none[-9.0] == pytest.approx(none[MOST_BEYOND[0]])
    assert none[MOST_BEYOND[0]] > none[0.0] > none[2.0] > none[9.0] == pytest.approx(none[MOST_BEYOND[1]])
    more = WEIGHTS.judged(account(shape, left=(usual(shape, 2.0),)))
    assert odds(more, "unknown") == pytest.approx(-2.0 + 2.0)
    two = WEIGHTS.judged(account(shape, left=(usual(shape, 2.0), usual(shape, 0.5))))
    assert odds(two, "unknown") == pytest.approx(-2.0 + 0.5), "by the recording that is followed better"


def test_an_effect_that_explains_it_is_named_all_the_same():
    assert WEIGHTS.judged(account(astray=(0.15, 0.15), wind=Explained(3.0, 3.0, 3.0))).best == "wind"


def test_the_weights_that_are_shipped_believe_what_explains_much_and_nothing_else():
    shipped = Weighing.shipped()
    assert all(np.isfinite(getattr(shipped, field.name)) for field in fields(shipped))
    much, little = Explained(1.5, 1.5, 1.5), Explained(0.05, 0.05, 0.05)
    for shape in ("rope", "sheet", "solid"):
        assert shipped.judged(account(shape, (0.02, 0.02), wind=much)).best == "wind"
        assert shipped.judged(account(shape, (0.02, 0.02), wind=little)).best == "none"
        assert shipped.judged(account(shape, (0.3, 0.3))).best == "unknown"
        less = replace(much, fitted=1.0)
        both = shipped.judged(account(shape, (0.02, 0.02), wind=much, damage=less))
        assert both.ranked[:2] == ("wind", "damage")
