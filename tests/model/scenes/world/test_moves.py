import numpy as np
import pytest

from model.scenes.world.moves import direction, ease, rise, sway, turn, upright

TIMES = np.arange(90) / 30.0


def test_easing_begins_and_ends_at_rest():
    share = ease(TIMES, 0.5, 1.5)
    assert share[0] == 0.0
    assert share[-1] == 1.0
    assert (np.diff(share) >= 0.0).all()
    assert np.abs(np.diff(share, 2)).max() * 30.0**2 < 6.0


@pytest.mark.parametrize("way", [lambda r: rise(TIMES, 0.3, r), lambda r: sway(TIMES, 0.05, r)])
def test_ways_begin_where_the_hand_is(way):
    for seed in range(5):
        moved = way(np.random.default_rng(seed))
        np.testing.assert_allclose(moved[0], 0.0, atol=1e-12)
        assert np.linalg.norm(moved, axis=1).max() > 0.01


def test_a_hand_rises_to_its_height_and_turns_no_farther_than_it_can():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        assert rise(TIMES, 0.3, rng)[:, 2].max() == pytest.approx(0.3, rel=0.02)
        assert np.linalg.norm(turn(TIMES, 0.4, rng), axis=1).max() <= 0.4


def test_upright_turns_anything_to_the_vertical():
    rng = np.random.default_rng(0)
    for up in (*rng.normal(size=(5, 3)), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -2.0])):
        np.testing.assert_allclose(upright(up).apply(up / np.linalg.norm(up)), [0.0, 0.0, 1.0], atol=1e-9)


def test_directions_are_horizontal_units():
    found = direction(np.random.default_rng(0))
    assert found[2] == 0.0
    assert np.linalg.norm(found) == pytest.approx(1.0)
