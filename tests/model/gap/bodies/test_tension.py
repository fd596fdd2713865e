"""A cloth pulls and never pushes: what that cannot hold up stands."""

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.guess import guess_shape
from model.gap.bodies.tension import stands, unsupported
from model.types import Observation

NOISE = 1e-3
DOWN = np.array([0.0, 0.0, -9.81])


def seen(places, hands=(), ground=0.0, fall=0.0):
    """At rest, or falling as `fall` of gravity makes it, with noise."""
    held = np.asarray(hands, np.float32).reshape(-1, 3)
    times = np.arange(12) / 30.0
    noise = np.random.default_rng(4).normal(0, NOISE, (12, *places.shape))
    way = fall * 0.5 * DOWN * times[:, None, None] ** 2
    return Observation(
        times=times,
        points=(places[None] + noise + way).astype(np.float32),
        controllers=np.repeat(held[None], 12, 0),
        ground_height=ground,
    )


def faces(shift=0.0, side=0.012):
    """Top, front and left of a block of 18 × 11 × 7 cm, as a camera sees them."""
    x, y, z = (np.arange(0.5 * side, most, side) for most in (0.18, 0.11, 0.07))
    top = np.stack(np.meshgrid(x, y, [0.07], indexing="ij"), -1).reshape(-1, 3)
    front = np.stack(np.meshgrid(x, [0.0], z, indexing="ij"), -1).reshape(-1, 3)
    left = np.stack(np.meshgrid([0.0], y, z, indexing="ij"), -1).reshape(-1, 3)
    return np.concatenate([top, front, left]) + np.array([0.0, 0.0, shift])


@pytest.fixture
def cloth():
    """Points on a cloth of 0.4 × 0.3 m, from the middle."""
    u, v = np.meshgrid(np.linspace(-0.2, 0.2, 14), np.linspace(-0.15, 0.15, 11), indexing="ij")
    jitter = np.random.default_rng(2).uniform(-0.01, 0.01, (2, *u.shape))
    return np.stack([u + jitter[0], v + jitter[1], 0 * u], -1).reshape(-1, 3)


def test_three_faces_of_a_block_stand():
    places = faces()
    assert guess_shape(places) == "sheet", "they are as thin as a cloth"
    hand = places[(places[:, 0] < 0.02) & (places[:, 2] > 0.03)]
    for hands in ((), hand):
        recording = seen(places, hands)
        assert stands(recording, places)
        body = body_of(recording)
        assert body.shape == "solid"
        assert (body.points[:, 2] < 0.02).mean() > 0.2, "it has an underside"


def test_what_falls_or_is_in_the_air_is_not_asked():
    places = faces()
    assert not stands(seen(places, fall=1.0), places)
    raised = faces(0.2)
    assert not stands(seen(raised, raised[raised[:, 0] < 0.02]), raised)
    assert not stands(seen(places, ground=None), places)


def test_cloths_hang(cloth):
    x, y, _ = cloth.T
    ends = np.abs(x) > 0.19
    for sag in (0.05, 0.01, 0.0):  # the last is taut: whether it sags noise hides
        between = np.stack([0.95 * x, y, 0.3 - sag * (1 - (x / 0.2) ** 2)], -1)
        assert not stands(seen(between, between[ends]), between)
    flap = np.maximum(-0.05 - y, 0.0)  # taut between hands, and hanging down to the ground beside them
    partly = np.stack([x, y + flap, 0.1 - flap], -1)
    assert not stands(seen(partly, partly[ends & (flap == 0.0)]), partly)
    hanging = np.stack([x, 0.02 * np.sin(30 * x), y + 0.16], -1)
    assert not stands(seen(hanging, hanging[y > 0.14]), hanging)
    away = np.hypot(x, y)
    draped = np.stack([0.4 * x, 0.4 * y, 0.2 - 0.9 * np.maximum(away - 0.02, 0.0)], -1)
    assert not stands(seen(draped, [[0.0, 0.0, 0.2]]), draped)


def test_cloths_lie(cloth):
    x, y, z = cloth.T
    wrinkled = np.stack([x, y, 0.01 * (1 + np.cos(60 * x))], -1)
    assert not stands(seen(wrinkled), wrinkled)
    # one end lifted by a hand, the other one on the ground
    lifted = np.stack([0.9 * x, y, 0.3 * np.maximum(x, 0.0) ** 2 / 0.2 + z], -1)
    assert not stands(seen(lifted, lifted[x > 0.19]), lifted)


@pytest.mark.parametrize(
    ("way", "share"),
    [
        ((0.0, 0.0, -1.0), 0.0),  # straight below what it hangs from
        ((1.0, 0.0, -1.0), 0.5),  # at 45 degrees pull and sideways push are as large, and that counts half
        ((1.0, 0.0, 0.0), 1.0),  # level threads hold nothing
        ((0.0, 0.0, 1.0), 1.0),  # what is above would have to be pushed
    ],
)
def test_of_one_point_and_one_thread_the_share_is_known(way, share):
    places = np.stack([np.zeros(3), np.asarray(way)] + [np.array([50.0 + i, 50.0, 0.0]) for i in range(8)])
    loose = np.zeros(10, bool)
    loose[1] = True
    assert unsupported(places, loose, DOWN) == pytest.approx(share, abs=1e-6)


def test_of_a_row_between_two_hands_each_point_must_hang_below_its_neighbours():
    x = np.linspace(-1.0, 1.0, 21)
    loose = np.abs(x) < 0.99
    row = [np.stack([x, 0 * x, side * (1 - x**2)], -1) for side in (-0.4, 0.4)]
    # a parabola of equal loads is the shape of a hanging bridge
    assert unsupported(row[0], loose, DOWN) < 0.01
    assert unsupported(row[1], loose, DOWN) > 0.99


def test_it_does_not_matter_where_down_is():
    places = faces()
    loose = places[:, 2] > 0.02
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    known = unsupported(places, loose, DOWN)
    assert unsupported(places @ turn.T, loose, turn @ DOWN) == pytest.approx(known, abs=1e-3)
