"""Signs are least squares on inner products: the same as least squares on the residuals themselves."""

import numpy as np
import pytest

from model.gap.evidence import BLOCKS
from model.gap.signs import CONTEXT_NAMES, RIDGE, SIGN_NAMES, signs_of

SIZE = 400
SHAPE = "sheet"


@pytest.fixture
def ways():
    """Columns of very different size; wind has two probes, the second of which explains the gap."""
    rng = np.random.default_rng(4)
    random = {name: rng.normal(size=SIZE) for name in ("twin", "sensor", "hand", "weak", "strong", "other")}
    return [
        ("twin", {"stiffness": 0.0}, 1e3 * random["twin"]),
        ("sensor", {}, random["sensor"]),
        ("hand", {}, 1e-3 * random["hand"]),
        ("wind", {"x": 1.0}, random["weak"]),
        ("wind", {"x": 2.0}, 0.1 * random["strong"]),
        ("damage", {"rate": 1.0}, 20.0 * random["other"] + 5.0 * random["strong"]),
    ]


@pytest.fixture
def plain(ways, evened):
    rng = np.random.default_rng(5)
    return evened(rng.normal(size=SIZE) - 8.0 * ways[4][2] + 0.7e-3 * ways[0][2] + 0.4 * ways[1][2])


def value(signs, effect, name):
    return signs.each[signs.names.index(effect), SIGN_NAMES.index(name)]


def fitted(columns, plain, rows):
    """Strengths of the columns over some rows: least squares, with rows more for the ridge."""
    some = columns[rows]
    ridge = np.diag(np.sqrt(RIDGE * (some**2).sum(0)))
    return np.linalg.lstsq(np.concatenate([some, ridge]), np.append(-plain[rows], np.zeros(len(ridge))))[0]


def left_held_out(columns, plain):
    """Sum of squares left of each fifth by what was fitted to the others."""
    fifth = np.arange(SIZE) * BLOCKS // SIZE
    total = 0.0
    for b in range(BLOCKS):
        rest, part = fifth != b, fifth == b
        total += ((plain[part] + columns[part] @ fitted(columns, plain, rest)) ** 2).sum()
    return total


def columns_of(ways, *chosen):
    return np.stack([ways[i][2] for i in chosen], 1)


def test_what_is_foretold_is_least_squares_on_the_residuals(made, ways, plain):
    signs = signs_of(made(ways, plain), SHAPE, 2.0, False)
    assert signs.names == ("damage", "wind")
    assert signs.probe.tolist() == [5, 4]
    alone = min(left_held_out(columns_of(ways, 0), plain), (plain**2).sum())
    for name, chosen in (("wind", (0, 4)), ("damage", (0, 5))):
        direct = 1 - left_held_out(columns_of(ways, *chosen), plain) / alone
        assert value(signs, name, "foretold") == pytest.approx(direct, abs=1e-5)
    both = 1 - left_held_out(columns_of(ways, 0, 3, 4), plain) / alone
    assert value(signs, "wind", "all probes") == pytest.approx(both, abs=1e-5)
    assert value(signs, "wind", "foretold") > 0.25


def test_beside_sensors_and_beside_the_rival_only_what_is_left_counts(made, ways, plain):
    signs = signs_of(made(ways, plain), SHAPE, 2.0, False)
    for sign, beside in (("foretold beside sensors", (0, 1, 2)), ("beside the best other", (0, 5))):
        before = min(left_held_out(columns_of(ways, *beside), plain), (plain**2).sum())
        after = left_held_out(columns_of(ways, *beside, 4), plain)
        assert value(signs, "wind", sign) == pytest.approx(1 - after / before, abs=1e-5)
    assert value(signs, "damage", "beside the best other") < 0.1


def test_the_gain_is_of_the_whole_and_tells_how_strong_the_effect_is(made, ways, plain):
    signs = signs_of(made(ways, plain), SHAPE, 2.0, False)
    every = slice(None)
    columns = columns_of(ways, 0, 4)
    strengths = fitted(columns, plain, every)
    first = columns_of(ways, 0)
    before = ((plain + first @ fitted(first, plain, every)) ** 2).sum()
    direct = 1 - ((plain + columns @ strengths) ** 2).sum() / before
    assert value(signs, "wind", "gain") == pytest.approx(direct, abs=1e-5)
    assert signs.scale[1] == pytest.approx(strengths[1], rel=1e-4)
    assert signs.scale[1] == pytest.approx(8.0, abs=1.0)
    assert value(signs, "wind", "strength") == pytest.approx(np.log1p(signs.scale[1]))
    assert value(signs, "wind", "plausible") == 1.0


def test_an_effect_that_would_have_to_be_negative_is_implausible(made, ways, plain):
    turned = [*ways[:4], ("wind", {"x": 2.0}, -ways[4][2]), ways[5]]
    signs = signs_of(made(turned, plain), SHAPE, 2.0, False)
    assert value(signs, "wind", "plausible") == 0.0
    assert value(signs, "wind", "foretold") > 0.25


def test_the_best_leads_and_the_others_trail(made, ways, plain):
    signs = signs_of(made(ways, plain), SHAPE, 2.0, False)
    lead = value(signs, "wind", "foretold") - value(signs, "damage", "foretold")
    assert value(signs, "wind", "lead") == pytest.approx(lead)
    assert value(signs, "damage", "lead") == pytest.approx(-lead)


def test_what_acts_near_the_grip_explains_more_there(made, ways, plain):
    near = (np.arange(SIZE) * 2 * BLOCKS // SIZE) % 2 == 0
    here = [*ways[:4], ("wind", {"x": 2.0}, np.where(near, ways[4][2], 0.0)), ways[5]]
    signs = signs_of(made(here, plain), SHAPE, 2.0, False)
    assert value(signs, "wind", "near the grip") > 0.2
    away = [*ways[:4], ("wind", {"x": 2.0}, np.where(near, 0.0, ways[4][2])), ways[5]]
    assert value(signs_of(made(away, plain), SHAPE, 2.0, False), "wind", "near the grip") < -0.2


def test_effects_that_are_left_out_are_as_if_the_catalogue_had_none(made, ways, plain):
    without = signs_of(made(ways, plain), SHAPE, 2.0, False, leaving_out=("wind",))
    never = signs_of(made([*ways[:3], ways[5]], plain), SHAPE, 2.0, False)
    assert without.names == never.names == ("damage",)
    np.testing.assert_allclose(without.each, never.each)
    np.testing.assert_allclose(without.context, never.context)


def test_without_any_effect_there_are_no_signs_but_a_context(made, ways, plain):
    signs = signs_of(made(ways[:2], plain), "rope", np.e, True)
    assert signs.names == ()
    assert signs.each.shape == (0, len(SIGN_NAMES))
    known = dict(zip(CONTEXT_NAMES, signs.context.tolist(), strict=True))
    assert known["log misfit"] == pytest.approx(1.0)
    assert (known["rope"], known["sheet"], known["ground"], known["held"]) == (1.0, 0.0, 1.0, 0.0)
    assert (known["all effects"], known["best"], known["second"]) == (0.0, 0.0, 0.0)


def test_the_context_tells_what_sensors_and_the_best_effects_explain(made, ways, plain):
    signs = signs_of(made(ways, plain), SHAPE, 2.0, False)
    known = dict(zip(CONTEXT_NAMES, signs.context.tolist(), strict=True))
    alone = min(left_held_out(columns_of(ways, 0), plain), (plain**2).sum())
    sensors = 1 - left_held_out(columns_of(ways, 0, 1), plain) / alone
    assert known["sensors"] == pytest.approx(sensors, abs=1e-5)
    assert known["best"] == value(signs, "wind", "foretold")
    assert known["second"] == value(signs, "damage", "foretold")
    assert known["all effects"] > known["second"]
    assert known["held"] == 1.0
