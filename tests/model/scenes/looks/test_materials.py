"""What tells the materials apart."""

import numpy as np
import pytest

from model.scenes.looks import ALL_LOOKS
from model.scenes.looks.paint import draw_look

PLACES = np.random.default_rng(0).uniform(-0.1, 0.1, (3000, 3))


def piece(material: str, seed: int = 0):
    names = [look.material for look in ALL_LOOKS]
    return draw_look(names.index(material), np.random.default_rng(seed))


def contrast(look, step):
    """How much the albedo changes over a step [m], over its mean."""
    albedo = look.albedo(PLACES)
    return float(np.abs(look.albedo(PLACES + np.array(step)) - albedo).mean() / albedo.mean())


@pytest.mark.parametrize("look", ALL_LOOKS, ids=lambda look: look.material)
def test_a_look_is_the_same_piece_everywhere_and_finite(look):
    one = look.draw(np.random.default_rng(1))
    albedo, relief = one.albedo(PLACES), one.relief(PLACES)
    assert albedo.shape == relief.shape == PLACES.shape
    assert albedo.min() >= 0
    assert albedo.max() <= 1
    assert np.isfinite(relief).all()
    np.testing.assert_array_equal(one.albedo(PLACES[:7]), albedo[:7])
    dyes = {look.draw(np.random.default_rng(seed)).dye for seed in range(8)}
    assert len(dyes) == 8


def test_fur_and_denim_are_rough_plastic_and_silk_are_not():
    fine = (0.002, 0.001, 0.001)
    for seed in range(4):
        smooth = max(contrast(piece(name, seed), fine) for name in ("plastic", "silk"))
        rough = min(contrast(piece(name, seed), fine) for name in ("fur", "denim"))
        assert rough > 3 * smooth


def test_wood_metal_and_silk_have_a_grain():
    for name in ("wood", "metal"):
        look = piece(name)
        assert contrast(look, (0.002, 0, 0)) < 0.5 * contrast(look, (0, 0.002, 0))
    silk = piece("silk")
    along, across = (
        np.abs(silk.relief(PLACES + np.array(step)) - silk.relief(PLACES)).mean()
        for step in ((0.004, 0, 0), (0, 0.004, 0))
    )
    assert along < 0.6 * across


def test_colours_are_those_of_the_material():
    for seed in range(6):
        mean = {
            name: piece(name, seed).albedo(PLACES).mean(axis=0)
            for name in ("denim", "leather", "paper", "rubber")
        }
        assert mean["denim"][2] > mean["denim"][0] + 0.04
        assert mean["leather"][0] >= mean["leather"][2]
        assert mean["paper"].mean() > 0.45
        assert mean["rubber"].mean() < 0.35


def test_only_some_are_glossy_one_is_metal_and_one_has_hair():
    finish = {look.material: look.finish for look in ALL_LOOKS}
    assert finish["plastic"].gloss > finish["silk"].gloss > finish["rubber"].gloss > finish["fabric"].gloss
    assert [name for name, one in finish.items() if one.metallic] == ["metal"]
    assert [name for name, one in finish.items() if one.pile > 0] == ["fur"]
    assert max(finish[name].specular for name in ("fabric", "denim", "paper", "fur")) < 0.05


def test_paper_is_creased_into_facets():
    paper = piece("paper")
    same = (paper.relief(PLACES + 0.001) == paper.relief(PLACES)).all(axis=1)
    assert 0.7 < same.mean() < 1
    assert np.linalg.norm(paper.relief(PLACES), axis=1).mean() > 0.25
