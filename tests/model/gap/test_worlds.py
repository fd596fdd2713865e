"""Random worlds: the same by seed, and with what they say is in them."""

import numpy as np
import pytest

from model.gap.effects import SteadyWind
from model.gap.worlds import FRAMES, POINTS, make_world, random_effects
from model.observation_doubts import observation_doubts

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plain():
    return make_world(3)


def test_the_same_seed_is_the_same_world(plain):
    again = make_world(3)
    np.testing.assert_array_equal(again.observation.points, plain.observation.points)
    assert again.shape == plain.shape


def test_it_is_seen_as_a_camera_sees(plain):
    points = plain.observation.points
    assert points.shape == (FRAMES, POINTS, 3)
    assert 0.0 < np.isnan(points).mean() < 0.3
    assert np.isfinite(points[0]).all()
    assert observation_doubts(plain.observation) == ()


def test_nothing_missing_makes_no_gap(plain):
    assert plain.amplitude == 0.0
    assert plain.effects == ()


def test_an_effect_makes_one(plain):
    windy = make_world(3, (SteadyWind,))
    assert windy.effects == ("wind",)
    assert windy.amplitude > 1e-3
    np.testing.assert_array_equal(windy.observation.controllers[0], plain.observation.controllers[0])


def test_a_third_has_no_effect():
    rng = np.random.default_rng(0)
    counts = [len(random_effects(rng)) for _ in range(600)]
    assert np.mean(np.equal(counts, 0)) == pytest.approx(0.33, abs=0.06)
    assert np.mean(np.equal(counts, 2)) == pytest.approx(0.17, abs=0.05)
