import pytest

from model.gap.effects import ALL_EFFECTS, SteadyWind, Viscoelasticity
from model.gap.probes import probes


def test_what_shapes_an_effect_is_tried_in_all_combinations():
    tried = probes(SteadyWind())
    assert [(each["x"], each["y"]) for each in tried] == [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]


def test_the_rest_is_at_its_start():
    effect = Viscoelasticity()
    assert {name for each in probes(effect) for name in each} == set(effect.quantities)
    for name in effect.quantities.keys() - effect.grid.keys():
        assert {each[name] for each in probes(effect)} == {effect.quantities[name].start}


@pytest.mark.parametrize("effect", ALL_EFFECTS, ids=lambda effect: effect.name)
def test_every_effect_is_tried_within_its_bounds_and_not_where_it_is_absent(effect):
    for values in probes(effect()):
        for name, value in values.items():
            low, high = effect.quantities[name].bounds
            assert low <= value <= high, name
        assert any(values[name] != absent for name, absent in effect.absent.items())
