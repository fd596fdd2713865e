import numpy as np
import pytest

from model.scenes.world.body import Solid
from model.scenes.world.interactions import ALL_INTERACTIONS, FPS, Handled, draw_script
from model.scenes.world.shapes import draw_shape


@pytest.fixture(scope="module")
def handled():
    shape = draw_shape("foam", np.random.default_rng(2))
    assert isinstance(shape.body, Solid)
    places = shape.body.surface(400, np.random.default_rng(0))
    return Handled(places, shape.body.normals(places), shape.grips, 2e4, solid=True)


@pytest.mark.parametrize("name", ALL_INTERACTIONS)
def test_scripts_begin_at_the_surface_above_the_ground_and_move_as_hands_can(name, handled):
    for seed in range(8):
        script = draw_script(name, handled, np.random.default_rng(seed))
        frames = len(script.times)
        assert 40 <= frames <= 75
        placed = handled.surface @ script.rotation.T + script.shift
        assert placed[:, 2].min() > 0.0
        assert script.controllers.shape[0] == script.hands.shape[0] == frames
        np.testing.assert_allclose(script.rotation @ script.rotation.T, np.eye(3), atol=1e-9)
        if name == "drop":
            assert script.controllers.shape[1] == 0
            continue
        gaps = np.linalg.norm(script.controllers[0][:, None] - placed, axis=2).min(axis=1)
        assert gaps.max() < 0.01
        speed = np.linalg.norm(np.diff(script.controllers, axis=0), axis=2) * FPS
        assert speed.max() < 2.0
        assert np.linalg.norm(script.controllers - script.controllers[0], axis=2).max() > 1e-3


def test_two_hands_hold_two_ends(handled):
    for name, hands in (("lift", 1), ("double_lift", 2), ("stretch", 2), ("shake", 1)):
        script = draw_script(name, handled, np.random.default_rng(0))
        assert script.hands.shape[1] == hands
    apart = np.linalg.norm(script.hands[0, 0] - script.controllers[0].mean(axis=0))
    assert apart < 0.02
    script = draw_script("stretch", handled, np.random.default_rng(0))
    gap = np.linalg.norm(script.hands[:, 0] - script.hands[:, 1], axis=1)
    assert gap.max() > 1.02 * gap[0]


def test_a_stiff_object_is_stretched_less(handled):
    assert strain(handled, 1e3, 3) > 3.0 * strain(handled, 1e6, 3)


def test_how_far_an_object_is_stretched_does_not_tell_its_modulus_exactly(handled):
    strains = [strain(handled, 7e4, seed) for seed in range(40)]
    assert 0.4 < np.log(strains).std() < 1.0


def strain(handled, modulus, seed):
    """How far hands stretch an object of this softest modulus, at most."""
    one = Handled(handled.surface, handled.normals, handled.grips, modulus, solid=True)
    hands = draw_script("stretch", one, np.random.default_rng(seed)).hands
    gap = np.linalg.norm(hands[:, 0] - hands[:, 1], axis=1)
    return gap.max() / gap[0] - 1.0


def test_what_falls_rises_first_and_what_is_lifted_lies(handled):
    low = {}
    for name in ("drop", "lift", "shake"):
        script = draw_script(name, handled, np.random.default_rng(1))
        low[name] = (handled.surface @ script.rotation.T + script.shift)[:, 2].min()
    assert low["lift"] == pytest.approx(0.0005)
    assert low["drop"] >= 0.05
    assert low["shake"] >= 0.05
