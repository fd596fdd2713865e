from dataclasses import replace

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.playground.edit import edited, scaled_stiffness
from model.playground.settings import settings_of


def test_what_is_not_touched_stays(plain_twin):
    assert edited(plain_twin, settings_of(plain_twin)) is plain_twin
    changed = edited(plain_twin, replace(settings_of(plain_twin), friction=0.9))
    assert changed.parameters.globals["friction"].value == 0.9
    assert changed.parameters.globals["friction"].source == "user"
    assert changed.parameters.globals["dashpot_damping"] == plain_twin.parameters.globals["dashpot_damping"]
    np.testing.assert_array_equal(changed.parameters.stiffness, plain_twin.parameters.stiffness)


def test_an_edited_twin_is_another_twin_and_says_so(plain_twin):
    changed = edited(replace(plain_twin, preview=b"film"), replace(settings_of(plain_twin), drag_rate=2.0))
    assert changed.manifest.id != plain_twin.manifest.id
    assert changed.manifest.stages[-1].name == "playground"
    assert changed.preview is None


def test_a_part_is_stiffened_and_a_spring_between_two_takes_their_mean(twin):
    stiffness = scaled_stiffness(twin, (4.0, 1.0))
    parts = twin.topology.part[twin.topology.springs].sum(axis=1)
    ratio = stiffness / twin.parameters.stiffness
    for both, factor in ((0, 4.0), (1, 2.0), (2, 1.0)):
        np.testing.assert_allclose(ratio[parts == both], factor, rtol=1e-5)
    assert {0, 1, 2} == set(parts.tolist())


def test_a_ground_goes_and_comes(plain_twin):
    settings = settings_of(plain_twin)
    gone = edited(plain_twin, replace(settings, ground=False))
    assert "ground_height" not in gone.parameters.globals
    back = edited(gone, replace(settings_of(gone), ground=True, ground_height=0.05))
    assert back.parameters.globals["ground_height"].value == 0.05


def test_wind_becomes_an_effect_and_a_diagnosed_one_keeps_where_it_acts(twin, effect):
    blown = edited(twin, replace(settings_of(twin), wind=(2.0, 0.0), air_grip=1.0))
    assert [record.name for record in blown.effects] == ["wind"]
    assert blown.effects[0].parameters["x"]["value"] == 2.0
    where = (0.5,) * len(twin.topology.points)
    given = replace(twin, effects=(effect("wind").model_copy(update={"acts_on": where}),))
    turned = edited(given, replace(settings_of(given), wind=(0.0, 1.0)))
    assert turned.effects[0].acts_on == where
    assert turned.effects[0].parameters["y"]["value"] == 1.0


def test_effects_are_switched_off_but_not_the_users_wind(twin, effect):
    given = replace(twin, effects=(effect("quadratic_air_drag"), effect("wind")))
    settings = replace(settings_of(given), effects=False)
    assert edited(given, settings).effects == ()
    blown = edited(given, replace(settings, wind=(3.0, 0.0)))
    assert [record.name for record in blown.effects] == ["wind"]


def test_self_contact_is_switched_off(twin):
    off = edited(twin, replace(settings_of(twin), self_contact=False))
    assert "self_collision" in twin.simulator().contacts
    assert "self_collision" not in off.simulator().contacts


def test_what_is_saved_moves_as_it_was_edited(twin, tmp_path):
    settings = replace(settings_of(twin), gravity=(0.0, 0.0, -3.0), stiffness=(2.0, 0.5), wind=(1.0, 0.0))
    made = edited(twin, settings)
    made.save(tmp_path / "edited.twin.zip")
    found = TwinBundle.load(tmp_path / "edited.twin.zip")
    assert settings_of(found) == replace(settings, stiffness=(1.0, 1.0))
    np.testing.assert_array_equal(found.rollout().points, made.rollout().points)
    assert np.abs(made.rollout().points - twin.rollout().points).max() > 1e-3


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_the_statistics_of_a_part_are_those_of_its_springs(twin, factor):
    from model.schema import PartRecord

    given = replace(twin, parts=(PartRecord(label="soft"), PartRecord(label="hard")))
    made = edited(given, replace(settings_of(given), stiffness=(factor, 1.0)))
    inside = (given.topology.part[given.topology.springs] == 0).all(axis=1)
    expected = factor * float(given.parameters.stiffness[inside].mean())
    assert made.parts[0].stiffness.mean == pytest.approx(expected, rel=1e-5)
    assert made.parts[0].stiffness.springs == inside.sum()
