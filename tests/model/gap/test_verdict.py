"""From probabilities to a verdict: doubts, look-alikes, a second effect."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.classifier import CLASSES
from model.gap.effects import ALL_EFFECTS, Damage, Plasticity, SteadyWind
from model.gap.signs import signs_of
from model.gap.verdict import Judged, alike, isolability, second_of

SIZE = 400


EVERY = {kind.name: kind() for kind in ALL_EFFECTS}


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
def beside(block):
    """A function: the effects, and the block with the first of them."""

    def of(kind):
        start = {name: torch.tensor(q.start, dtype=torch.float64) for name, q in kind.quantities.items()}
        return EVERY, kind().apply(block, start)

    return of


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


@pytest.mark.parametrize(("nothing", "answer"), [(0.2, "wind"), (0.26, "none"), (0.45, "none")])
def test_nothing_is_missing_where_no_answer_is_likelier(nothing, answer):
    judged = said(none=nothing, wind=0.26, gravity_tilt=0.19)
    assert judged.best == answer
    assert judged.effect == (None if answer == "none" else answer)


def test_of_equals_the_best_is_the_first_of_the_ranking():
    judged = Judged({"wind": 0.4, "gravity_tilt": 0.4, "none": 0.1, "unknown": 0.1} | _nothing())
    assert (judged.best, judged.effect) == ("wind", "wind")
    backwards = Judged(dict(reversed(list(judged.chances.items()))))
    assert (backwards.best, backwards.effect) == ("wind", "wind")


def _nothing():
    return dict.fromkeys(set(CLASSES) - {"wind", "gravity_tilt", "none", "unknown"}, 0.0)


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


def test_a_second_effect_explains_what_the_first_leaves(two, beside):
    signs = signs_of(two, "sheet", 2.0, False)
    assert second_of(said(wind=0.6, damage=0.3), signs, two, *beside(SteadyWind)) == "damage"


def test_a_look_alike_is_no_second_effect_but_the_next_may_be(two, beside):
    signs = signs_of(two, "sheet", 2.0, False)
    judged = said(wind=0.4, gravity_tilt=0.3, damage=0.2)
    assert second_of(judged, signs, two, *beside(SteadyWind)) == "damage"


@pytest.mark.parametrize(("first", "other"), [(Damage, Plasticity), (Plasticity, Damage)])
def test_what_cannot_act_beside_the_first_is_no_second_effect_but_the_next_may_be(
    first, other, made, ways, evened, beside
):
    yielding = np.random.default_rng(9).normal(size=SIZE)
    columns = {**ways, "plasticity": ("plasticity", {"rate": 1.0}, yielding)}
    both = sum(columns[name][2] for name in ("damage", "plasticity", "grip_slip"))
    evidence = made(list(columns.values()), evened(np.random.default_rng(8).normal(size=SIZE) - both))
    signs = signs_of(evidence, "sheet", 2.0, False)
    judged = said(**{first.name: 0.4, other.name: 0.3, "grip_slip": 0.2})
    assert second_of(judged, signs, evidence, *beside(SteadyWind)) == other.name
    assert second_of(judged, signs, evidence, *beside(first)) == "grip_slip"


def test_there_is_no_second_that_is_unlikely_explains_nothing_or_cannot_act(two, beside):
    signs = signs_of(two, "sheet", 2.0, False)
    with_wind = beside(SteadyWind)
    assert second_of(said(wind=0.9, damage=0.09), signs, two, *with_wind) is None
    assert second_of(said(wind=0.5, grip_slip=0.4), signs, two, *with_wind) is None
    assert second_of(said(adhesion=0.6, damage=0.3), signs, two, *with_wind) is None
    alone = replace(
        signs, names=("wind",), each=signs.each[-1:], probe=signs.probe[-1:], scale=signs.scale[-1:]
    )
    assert second_of(said(wind=0.5, damage=0.4), alone, two, *with_wind) is None
