import numpy as np
import pytest

from model.priors.materials import MATERIALS, typical
from model.scenes.world.materials import LIKELY, draw_substance, draw_substances
from model.scenes.world.shapes import CLASSES


def test_draws_are_log_normal_about_what_is_typical():
    rng, row = np.random.default_rng(0), typical("denim", "sheet")["stiffness"]
    index = MATERIALS.index("denim")
    logs = np.log([draw_substance(index, "sheet", rng).stiffness for _ in range(600)])
    assert np.exp(logs.mean()) == pytest.approx(row.mean, rel=0.12)
    assert logs.std() == pytest.approx(row.spread, rel=0.12)
    assert np.abs(logs - np.log(row.mean)).max() <= 2.0 * row.spread + 1e-9


def test_parts_of_one_material_are_one_substance_and_mixed_objects_mix():
    rng = np.random.default_rng(1)
    for _ in range(20):
        parts = draw_substances("plush", "solid", 5, rng)
        by_material = {one.material: one for one in parts}
        assert all(by_material[one.material] is one for one in parts)
        assert len({one.material for one in draw_substances("mixed", "solid", 2, rng)}) == 2


def test_every_material_occurs_and_every_class_knows_some():
    assert set(LIKELY) == set(CLASSES)
    assert {name for weights in LIKELY.values() for name in weights} == set(MATERIALS)
