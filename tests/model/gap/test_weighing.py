"""From what fits explain to probabilities: a conditional logit, checked against its closed form."""

from dataclasses import fields, replace

import numpy as np
import pytest

from model.gap.account import Account, Explained
from model.gap.schema import EFFECT_NAMES
from model.gap.weighing import (
    HEALTHY,
    MOST_BEYOND,
    RESIDUE,
    SIMPLER,
    SLIGHT,
    WIDTH,
    Weighing,
    beyond,
    surely_explained,
)

WEIGHTS = Weighing(
    effect=-5.0,
    fitted=3.0,
    later=2.0,
    elsewhere=4.0,
    slowly=1.5,
    slowly_elsewhere=2.5,
    harm=5.0,
    buckling=-4.0,
    unknown=-2.0,
    left=0.0,
    flexible=1.5,
)
AGAINST = replace(WEIGHTS, left=1.0)
"""What is left counts as well."""
ALIKE = dict.fromkeys(EFFECT_NAMES, 1.0 / len(EFFECT_NAMES))


def usual(shape, beyond=0.0):
    """What is left of a healthy twin, or so many standard deviations more."""
    mean, spread = HEALTHY[shape]
    return float(np.exp(mean + beyond * spread))


def account(shape="rope", screened=ALIKE, left=None, **explained):
    return Account(shape, screened, explained, {}, (usual(shape),) if left is None else left)


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


@pytest.mark.parametrize(("shape", "by"), [("rope", SIMPLER), ("solid", 0.0)])
def test_a_rope_that_never_yields_is_an_elastic_rod(shape, by):
    same = Explained(1.0, 0.5, 0.25)
    told = replace(account(plasticity=same, bending_stiffness=same), shape=shape)
    assert odds(WEIGHTS.judged(told), "bending_stiffness", "plasticity") == pytest.approx(by, abs=1e-9)


def test_two_that_are_simpler_than_one_are_each_likelier_by_as_much():
    same = Explained(1.0, 0.5, 0.25)
    every = {"plasticity": same, "bending_stiffness": same, "viscoelasticity": same, "damage": same}
    judged = WEIGHTS.judged(replace(account(**every), shape="rope"))
    for simple in ("bending_stiffness", "viscoelasticity"):
        assert odds(judged, simple, "plasticity") == pytest.approx(SIMPLER)
    three = sum(judged.chances[name] for name in ("plasticity", "bending_stiffness", "viscoelasticity"))
    assert three == pytest.approx(3.0 * judged.chances["damage"])


def test_a_tilt_that_was_not_fitted_takes_nothing_from_a_wind():
    judged = WEIGHTS.judged(account(wind=Explained(1.0)))
    assert odds(judged, "wind", "gravity_tilt") == pytest.approx(3.0)


def test_slack_springs_have_to_explain_more_in_what_buckles():
    solid, sheet, rope = (
        WEIGHTS.judged(account(shape, tension_only=Explained(2.0))) for shape in ("solid", "sheet", "rope")
    )
    assert odds(solid, "tension_only") == pytest.approx(1.0)
    assert odds(rope, "tension_only") == pytest.approx(-3.0)
    assert odds(sheet, "tension_only") == pytest.approx(-3.0)


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


@pytest.mark.parametrize("shape", ["rope", "sheet", "solid"])
def test_a_twin_that_leaves_more_than_healthy_ones_do_lacks_something(shape):
    none = {
        more: AGAINST.judged(account(shape, left=(usual(shape, more),))).chances["none"]
        for more in (-9.0, MOST_BEYOND[0], 0.0, 2.0, MOST_BEYOND[1], 9.0)
    }
    assert none[-9.0] == pytest.approx(none[MOST_BEYOND[0]])
    assert none[MOST_BEYOND[0]] > none[0.0] > none[2.0] > none[9.0] == pytest.approx(none[MOST_BEYOND[1]])
    more = AGAINST.judged(account(shape, left=(usual(shape, 2.0),)))
    assert odds(more, "unknown") == pytest.approx(-2.0 + 2.0)
    two = AGAINST.judged(account(shape, left=(usual(shape, 2.0), usual(shape, 0.5))))
    assert odds(two, "unknown") == pytest.approx(-2.0 + 1.25), "by both recordings alike"
    one = AGAINST.judged(account(shape, left=(usual(shape, 90.0), usual(shape))))
    assert odds(one, "unknown") == pytest.approx(-2.0 + 0.5 * MOST_BEYOND[1]), "a fold says only so much"


def test_what_other_lattices_leave_of_a_twin_is_no_sign_of_anything():
    """A twin that follows itself on other lattices as badly as what was seen is as good as one can be."""
    calm, wild = (replace(account("sheet", left=(40.0,)), lattices=(each,)) for each in (0.1, 40.0 - RESIDUE))
    assert beyond(wild) == pytest.approx(0.0)
    assert beyond(calm) == pytest.approx(min((np.log(40.0) - np.log(RESIDUE + 0.1)) / WIDTH, MOST_BEYOND[1]))
    assert AGAINST.judged(wild).best == "none"
    assert odds(AGAINST.judged(calm), "unknown") == pytest.approx(-2.0 + beyond(calm))
    assert beyond(replace(calm, lattices=(None,))) == beyond(account("sheet", left=(40.0,)))


def test_each_recording_has_its_own_lattices():
    left = (RESIDUE * np.exp(WIDTH), 9.0 * RESIDUE)
    two = replace(account("sheet", left=left), lattices=(0.0, 8.0 * RESIDUE))
    assert beyond(two) == pytest.approx(0.5)
    assert beyond(two.alone) == pytest.approx(1.0)


def test_with_the_effect_that_is_missing_a_twin_leaves_as_little_as_healthy_ones_do():
    """So much of it as an effect explains speaks against it no more; what no answer explains is unknown."""
    _, width = HEALTHY["rope"]
    left = (usual("rope", 3.0), usual("rope", 2.0))
    wholly = replace(account(left=left), shared={"wind": Explained(3.0 * width, 0.0, 2.0 * width)})
    judged = AGAINST.judged(wholly)
    assert odds(judged, "wind") == pytest.approx(-5.0 + (3.0 * 3.0 + 4.0 * 2.0) * width + 2.5)
    assert odds(judged, "damage") == pytest.approx(-5.0), "what explains nothing leaves as much as none"
    assert odds(judged, "unknown", "damage") == pytest.approx(-2.0 + 2.5 + 5.0)
    partly = replace(wholly, shared={"wind": Explained(width, 0.0, -0.5 * width)})
    harmed = AGAINST.judged(partly)
    assert odds(harmed, "wind") == pytest.approx(-5.0 + (3.0 - 9.0 * 0.5) * width + 0.5 * (1.0 - 0.5))


def test_an_effect_that_explains_it_is_named_all_the_same():
    far = (usual("rope", 9.0),)
    assert AGAINST.judged(account(left=far, wind=Explained(3.0, 3.0, 3.0))).best == "wind"
    assert AGAINST.judged(account(left=far, wind=Explained())).best == "unknown"


def test_the_weights_that_are_shipped_believe_what_explains_much_and_nothing_else():
    shipped = Weighing.shipped()
    assert all(np.isfinite(getattr(shipped, field.name)) for field in fields(shipped))
    much, little = Explained(1.5, 1.5, 1.5), Explained(0.05, 0.05, 0.05)
    for shape in ("rope", "sheet", "solid"):
        near, far = (usual(shape),) * 2, (usual(shape, 4.0),) * 2
        assert shipped.judged(account(shape, left=near, wind=much)).best == "wind"
        assert shipped.judged(account(shape, left=near, wind=little)).best == "none"
        assert shipped.judged(account(shape, left=far)).best == "unknown"
        assert shipped.judged(account(shape, left=far, wind=much)).best == "wind"
        less = replace(much, fitted=1.0)
        both = shipped.judged(account(shape, left=near, wind=much, damage=less))
        assert both.ranked[:2] == ("wind", "damage")


def test_what_is_explained_counts_as_far_as_other_lattices_do_not_leave_as_much():
    """Of 40 that are left an effect leaves a quarter: of a twin whose lattices go alike that is ln 4."""
    wind = Explained(np.log(4.0), np.log(2.0), slowly=np.log(3.0))
    calm = account("sheet", left=(40.0,), wind=wind)
    assert surely_explained(calm, wind) == wind
    assert surely_explained(replace(calm, lattices=(0.0,)), wind) == wind
    assert surely_explained(replace(calm, lattices=(None,)), wind) == wind
    wild = surely_explained(replace(calm, lattices=(40.0,)), wind)
    assert wild.fitted == pytest.approx(np.log(80.0 / 50.0))
    assert wild.later == pytest.approx(np.log(80.0 / 60.0))
    assert wild.slowly == pytest.approx(np.log(3.0 / 2.0))
    harmful = surely_explained(replace(calm, lattices=(40.0,)), Explained(-np.log(2.0)))
    assert harmful.fitted == pytest.approx(np.log(80.0 / 120.0))


def test_what_is_explained_elsewhere_counts_by_the_lattices_there():
    both = Explained(np.log(4.0), elsewhere=np.log(4.0), slowly_elsewhere=np.log(2.0))
    two = replace(account("sheet", left=(40.0, 10.0)), shared={"wind": both}, lattices=(0.0, 10.0))
    sure = surely_explained(two, both)
    assert sure.fitted == pytest.approx(np.log(4.0))
    assert sure.elsewhere == pytest.approx(np.log(20.0 / 12.5))
    assert sure.slowly_elsewhere == pytest.approx(np.log(20.0 / 15.0))
    blind = replace(two, lattices=(0.0, None))
    assert surely_explained(blind, both) == both
    judged = AGAINST.judged(two).chances
    assert judged["wind"] < AGAINST.judged(replace(two, lattices=(0.0, 0.0))).chances["wind"]
