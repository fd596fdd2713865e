from dataclasses import replace

import numpy as np
import pytest
import torch

from model.bundle import TwinBundle
from model.errors import InputError
from model.gap.carried import CATALOGUE, carrying, record_of, values_of
from model.gap.effects import (
    ALL_EFFECTS,
    ActuationDelay,
    Damage,
    Plasticity,
    StrainStiffening,
    TensionOnly,
)
from model.schema import EffectRecord


def starts(kind) -> dict[str, float]:
    return {name: quantity.start for name, quantity in kind.quantities.items()}


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_a_record_moves_the_twin_as_the_effect_it_was_made_of(kind, block):
    record = record_of(kind, starts(kind), intervals={next(iter(kind.quantities)): (0.1, 0.2)})
    read = EffectRecord.model_validate_json(record.model_dump_json())
    values = {name: torch.tensor(value, dtype=torch.float64) for name, value in starts(kind).items()}
    with torch.no_grad():
        expected = kind().apply(block, values).rollout(last=6, substeps=60).points
        carried = carrying(block, [read]).rollout(last=6, substeps=60).points
    torch.testing.assert_close(carried, expected, rtol=0, atol=0)


def test_a_late_hand_of_which_one_place_is_known_is_there(twin_path):
    bundle = TwinBundle.load(twin_path)
    late = replace(
        bundle, controls=bundle.controls[:1], effects=(record_of(ActuationDelay, {"delay": 0.05}),)
    )
    np.testing.assert_array_equal(
        late.rollout(substeps=100).points, replace(late, effects=()).rollout(substeps=100).points
    )


def test_effects_act_one_upon_the_other_and_where_they_are_told(block):
    count = len(block.system.points)
    half = torch.arange(count, dtype=torch.float64) < count / 2
    wind = record_of(ALL_EFFECTS[9], {"drag_per_mass": 5.0, "x": 3.0, "y": 0.0, "facing": 0.5})
    stiff = record_of(ALL_EFFECTS[0], {"stiffening": 500.0}, where=half.double())
    assert stiff.acts_on == (1.0,) * (count // 2) + (0.0,) * (count - count // 2)
    with torch.no_grad():
        both, one, whole = (
            carrying(block, records).rollout(last=8, substeps=200).points
            for records in ([wind, stiff], [wind], [wind, record_of(ALL_EFFECTS[0], {"stiffening": 500.0})])
        )
    assert float((both - one).abs().max()) > 1e-5
    assert float((both - whole).abs().max()) > 1e-5


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({}, "wind: drag_per_mass is missing: expected drag_per_mass, x, y"),
        (
            {"drag_per_mass": 1, "x": 1, "y": 0, "speed": 2},
            "wind has no parameter 'speed': expected drag_per_mass, x, y",
        ),
        ({"drag_per_mass": 1, "x": 11, "y": 0}, "wind: x: expected -8 to 8 m/s, found 11"),
        (
            {"drag_per_mass": 1, "x": "fast", "y": 0},
            "x: expected a number, or an object with .* found 'fast'",
        ),
        ({"drag_per_mass": 1, "x": True, "y": 0}, "x: expected a number, or an object with .* found True"),
        ({"drag_per_mass": 1, "x": {"unit": "m/s"}, "y": 0}, "x: expected a number, .* found None"),
        (
            {"drag_per_mass": 1, "x": {"value": 1, "unit": "km/h"}, "y": 0},
            "x: expected the unit m/s, found 'km/h'",
        ),
    ],
)
def test_parameters_that_no_effect_has_are_refused(parameters, line):
    with pytest.raises(InputError, match=line):
        values_of(EffectRecord(name="wind", parameters=parameters), "here")


def test_absence_is_no_breach_of_bounds():
    record = EffectRecord(name="wind", parameters={"drag_per_mass": 0.0, "x": 8.000001, "y": 0})
    assert values_of(record, "here")["drag_per_mass"] == 0.0


@pytest.mark.parametrize("other", [Damage, Plasticity])
def test_whose_springs_go_slack_first_makes_no_difference(other, block):
    slack, worn = record_of(TensionOnly, {"slackness": 0.8}), record_of(other, starts(other))
    with torch.no_grad():
        first, last = (
            carrying(block, records).rollout(last=8, substeps=200).points
            for records in ([slack, worn], [worn, slack])
        )
    torch.testing.assert_close(first, last, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "quantity", "value"),
    [("adhesion", "at_contact", 0.0), ("anisotropy", "sharpness", 1.0), ("plasticity", "hardening", 0.0)],
)
def test_what_was_saved_before_a_quantity_was_known_is_as_it_was(name, quantity, value):
    kind = CATALOGUE[name]
    record = record_of(kind, starts(kind))
    less = {key: given for key, given in record.parameters.items() if key != quantity}
    old = EffectRecord.model_validate({"name": name, "parameters": less})
    assert values_of(old, "effects.json: 0") == values_of(record, "effects.json: 0") | {quantity: value}


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_a_twin_need_not_say_what_does_nothing_in_it(kind, block):
    own = kind().within(block)
    record = record_of(own, {name: quantity.start for name, quantity in own.quantities.items()})
    whole = record_of(kind, starts(kind))
    with torch.no_grad():
        moved = [carrying(block, [one]).rollout(last=8, substeps=200).points for one in (record, whole)]
    assert torch.equal(*moved)


@pytest.mark.parametrize("order", [(Damage, Plasticity), (Plasticity, Damage)])
def test_damage_of_what_yields_is_refused(order, block):
    """Damage told from the first length would pull at a longer one for ever, and more the longer it is."""
    records = [record_of(kind, starts(kind)) for kind in order]
    with pytest.raises(InputError, match=f"1: {order[1].name} cannot act in this twin: its springs"):
        carrying(block, records)


def test_a_second_effect_of_a_name_is_refused(block):
    half = (torch.arange(len(block.system.points)) % 2).double()
    records = [record_of(StrainStiffening, {"stiffening": 50.0}, where=where) for where in (half, 1.0 - half)]
    with pytest.raises(InputError, match=r"1: strain_stiffening cannot act .* it carries one already"):
        carrying(block, records)


def test_what_cannot_act_is_refused(loose):
    record = record_of(ALL_EFFECTS[0], {"stiffening": 20.0})
    with pytest.raises(
        InputError, match="0: strain_stiffening cannot act in this twin: there are no springs"
    ):
        carrying(loose, [record])


class TestBundle:
    def test_a_twin_rolls_out_with_its_effects(self, twin_path, tmp_path):
        plain = TwinBundle.load(twin_path)
        drag = record_of(ALL_EFFECTS[8], {"drag_per_mass": 30.0, "facing": 0.5})
        replace(plain, effects=(drag,)).save(tmp_path / "other.twin.zip")
        twin = TwinBundle.load(tmp_path / "other.twin.zip")
        without, slowed = plain.rollout(substeps=60), twin.rollout(substeps=60)
        assert np.abs(slowed.points - without.points).max() > 1e-4
        again = twin.simulator().rollout(controls=plain.controls, substeps=60)
        np.testing.assert_allclose(again.points.detach().numpy(), slowed.points, atol=1e-7)

    @pytest.mark.parametrize("delay", [0.05, -0.05])
    def test_a_hand_that_is_late_is_late_in_rollouts(self, twin_path, delay):
        plain = TwinBundle.load(twin_path)
        late = replace(plain, effects=(record_of(ALL_EFFECTS[13], {"delay": delay}),))
        assert ALL_EFFECTS[13].name == "actuation_delay"
        there = plain.topology.controller_points
        steady = np.repeat(there[None], 5, axis=0)
        np.testing.assert_array_equal(
            late.rollout(steady, substeps=60).points, plain.rollout(steady, substeps=60).points
        )
        assert np.abs(late.rollout(substeps=60).points - plain.rollout(substeps=60).points).max() > 1e-4

    def test_an_effect_out_of_bounds_is_refused_where_it_is_read(self, write_twin):
        bad = b'[{"name": "quadratic_air_drag", "parameters": {"drag_per_mass": -1}}]'
        path = write_twin(files={"effects.json": bad})
        with pytest.raises(
            InputError, match=r"foreign.twin.zip: effects.json: 0: quadratic_air_drag: drag_per_mass"
        ):
            TwinBundle.load(path)

    def test_an_unknown_effect_is_refused(self, write_twin):
        with pytest.raises(InputError, match=r"effects.json: 0.name: .* found 'magnetism'"):
            TwinBundle.load(write_twin(files={"effects.json": b'[{"name": "magnetism"}]'}))

    def test_an_effect_of_a_ground_that_is_not_there_is_refused(self, twin_path):
        sticky = record_of(ALL_EFFECTS[14], {"pull_per_mass": 10.0, "reach": 0.005, "at_contact": 0.0})
        twin = replace(TwinBundle.load(twin_path), effects=(sticky,))
        with pytest.raises(InputError, match="adhesion cannot act in this twin: there is no ground"):
            twin.rollout()
