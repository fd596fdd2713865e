from dataclasses import replace

import pytest

from model.playground.settings import AIR_GRIP, settings_of


def test_the_twin_as_it_came(plain_twin):
    settings = settings_of(plain_twin)
    assert settings.gravity == (0.0, 0.0, -9.81)
    assert settings.ground
    assert settings.ground_height == pytest.approx(0.1)
    assert (settings.friction, settings.dashpot_damping, settings.drag_rate) == (0.4, 0.05, 0.8)
    assert not settings.self_contact
    assert (settings.wind, settings.air_grip) == ((0.0, 0.0), AIR_GRIP)
    assert settings.stiffness == (1.0, 1.0)


def test_without_a_ground_the_height_is_that_of_the_lowest_point(twin):
    settings = settings_of(twin)
    assert not settings.ground
    assert settings.ground_height == pytest.approx(float(twin.topology.points[:, 2].min()))
    assert settings.self_contact


def test_a_diagnosed_wind_blows(twin, effect):
    blown = replace(twin, effects=(effect("wind", drag_per_mass=0.3, x=1.5, y=-0.5),))
    assert settings_of(blown).wind == (1.5, -0.5)
    assert settings_of(blown).air_grip == 0.3
