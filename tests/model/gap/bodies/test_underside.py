"""A solid that lies reaches the ground, whatever of it a camera saw."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.underside import underside
from model.types import Observation

HALVES = np.array([0.1, 0.08, 0.06])
"""Half axes of an ellipsoid [m]."""


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def ball(rng, count=1600):
    """Points all over an ellipsoid that lies on the ground, and normals there."""
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    normals = ways / HALVES
    return ways * HALVES + [0.0, 0.0, HALVES[2]], normals / np.linalg.norm(normals, axis=1, keepdims=True)


def seen_from(degrees, rng, aside=(0.0, 0.0, 0.0)):
    """What a camera sees of it that looks down by so much; moved to elsewhere."""
    places, normals = ball(rng)
    angle = np.radians(degrees)
    return places[normals @ np.array([0.0, -np.cos(angle), np.sin(angle)]) > 0.1][::5] + np.array(aside)


def observed(places, ground=0.0):
    points = np.repeat(places[None].astype(np.float32), 4, 0)
    return Observation(np.arange(4) / 30.0, points, np.zeros((4, 0, 3), np.float32), ground_height=ground)


@pytest.mark.parametrize("degrees", [40, 60, 85])
@pytest.mark.parametrize("ground", [0.0, -0.3])
def test_what_is_seen_from_above_and_lies_reaches_the_ground(degrees, ground, rng):
    places = seen_from(degrees, rng, (0.4, -0.2, ground))
    found = underside(observed(places, ground), places)
    assert len(found)
    np.testing.assert_array_equal(found[:, 2], ground)
    # beneath it, about as far as it goes, and not beyond
    across = np.ptp(found[:, :2], axis=0) / (2 * HALVES[:2])
    assert (across > 0.5).all()
    assert (across < 1.0).all()
    body = body_of(observed(places, ground), "solid")
    assert body.points[:, 2].min() == pytest.approx(ground, abs=1e-6)
    # what bears it is below its middle: it does not tip over
    lying = body.points[body.points[:, 2] < ground + 0.3 * body.spacing]
    middle = (body.share[:, None] * body.points).sum(0)
    assert (lying[:, :2].min(0) < middle[:2]).all()
    assert (lying[:, :2].max(0) > middle[:2]).all()


def corner(rng, *, underside):
    """Points by lot all over an L on the ground, with its underside or without, and its middle [m]."""
    size, count = np.array([0.3, 0.25, 0.07]), 60_000
    at = rng.uniform(0.0, size, (count, 3))
    at = at[(at[:, 0] < 0.1) | (at[:, 1] < 0.1)]
    gap = np.stack([at[:, 0], at[:, 1], 0.3 - at[:, 0], 0.25 - at[:, 1], 0.07 - at[:, 2], at[:, 2]], -1)
    gap[:, :4] = np.minimum(gap[:, :4], np.maximum(0.1 - at[:, :2].min(1), 0.0)[:, None] + 1e-4)
    skin = (gap[:, :5] < 3e-3).any(1) | (underside & (gap[:, 5] < 3e-3))
    return at[skin][:200], at.mean(0)


@pytest.mark.parametrize("ground", [0.0, -0.3])
def test_what_is_seen_down_to_the_ground_is_filled_and_does_not_sink(ground, rng):
    seen, middle = corner(rng, underside=False)
    seen[:, 2] += ground + rng.normal(scale=5e-4, size=len(seen))
    found = underside(observed(seen, ground), seen)
    assert len(found) > 0.2 * len(seen)
    np.testing.assert_array_equal(found[:, 2], ground)
    # in the corner that it leaves free is nothing
    assert (found[:, :2].min(1) < 0.11).all()
    with_ground, alone = (body_of(observed(seen, each), "solid") for each in (ground, None))
    off = [
        np.linalg.norm(body.share @ body.points - middle - [0, 0, ground]) for body in (with_ground, alone)
    ]
    assert off[0] < 0.006
    assert off[0] < 0.75 * off[1]
    lying, bare = ((body.points[:, 2] < ground + 0.01).mean() for body in (with_ground, alone))
    assert lying > 1.5 * bare


def test_what_is_seen_all_around_is_left_as_it_is(rng):
    seen, _ = corner(rng, underside=True)
    assert not len(underside(observed(seen), seen))


RING, TUBE = 0.1, 0.03
"""Radii of a ring, and of its tube [m]."""


def test_a_ring_lies_on_its_tube_and_not_on_what_is_in_its_hole(ring):
    # cameras that look down from all around see its tube to a little below its middle
    seen = ring[ring[:, 2] > -0.4 * TUBE] + [0.0, 0.0, TUBE]
    found = underside(observed(seen), seen)
    away = np.linalg.norm(found[:, :2], axis=1)
    assert (np.abs(away - RING) < TUBE).all()
    # all around, no gap is wider than its tube
    angles = np.sort(np.arctan2(found[:, 1], found[:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    assert gaps.max() * RING < 2.0 * TUBE
    with_ground, alone = (body_of(observed(seen, each), "solid") for each in (0.0, None))
    high = [(body.share @ body.points)[2] - TUBE for body in (with_ground, alone)]
    assert abs(high[0]) < 0.5 * abs(high[1])


def test_what_a_hand_holds_by_its_rim_cannot_hang_with_its_middle_aside(rng):
    """From below its hand it may hang in the air, as high as half of it."""
    places = seen_from(50, rng, (0.0, 0.0, 0.05))
    for at, lies in (((HALVES[0], 0.0, 0.1), True), ((0.0, 0.0, 0.17), False)):
        hand = np.repeat(np.array([[at]], np.float32), 4, 0)
        found = underside(replace(observed(places), controllers=hand), places)
        assert bool(len(found)) == lies


def test_its_middle_is_where_that_of_the_whole_is(rng):
    """Of what is seen alone, the middle is nearer to the camera and higher."""
    seen, (whole, _) = seen_from(50, rng), ball(rng)
    with_ground, alone = (body_of(observed(seen, ground), "solid") for ground in (0.0, None))
    middle = whole.mean(0)
    off = [np.linalg.norm(body.share @ body.points - middle) for body in (with_ground, alone)]
    assert off[0] < 0.6 * off[1]


def test_nothing_is_added_where_the_underside_is_seen_or_there_is_no_ground(rng):
    whole, seen = ball(rng)[0] + [0.0, 0.0, 0.01], seen_from(50, rng)
    assert not len(underside(observed(whole), whole))
    assert not len(underside(observed(seen, None), seen))


def test_what_is_in_the_air_stays_there(rng):
    places = seen_from(50, rng, (0.0, 0.0, 0.2))
    assert not len(underside(observed(places), places))


def test_what_falls_or_is_held_a_little_above_the_ground_is_not_on_it(rng):
    places = seen_from(50, rng, (0.0, 0.0, 0.05))
    rests = observed(places)
    assert len(underside(rests, places))
    hand = np.repeat(places[:1][None].astype(np.float32), 4, 0)
    assert not len(underside(replace(rests, controllers=hand), places))
    since = rests.times[:, None] - rests.times[0]
    points = rests.points.copy()
    points[..., 2] -= (0.5 * 9.81 * since**2).astype(np.float32)
    assert not len(underside(replace(rests, points=points), places))


def test_an_upright_plane_has_no_underside(rng):
    places = np.stack([rng.uniform(0, 0.1, 60), np.zeros(60), rng.uniform(0.01, 0.1, 60)], -1)
    assert not len(underside(observed(places), places))


def test_what_a_hand_holds_out_by_its_end_is_in_the_air_where_its_underside_is_seen(rng):
    """A bottle that lies in the hand, as far above the ground as it is thick."""
    ways = rng.normal(size=(150, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    tilt = np.radians(35.0)
    turned = np.array([[np.cos(tilt), 0, -np.sin(tilt)], [0, 1, 0], [np.sin(tilt), 0, np.cos(tilt)]])
    whole = ways * [0.125, 0.04, 0.04] @ turned.T
    whole[:, 2] += 0.1 - whole[:, 2].min()
    hand = np.repeat(whole[whole[:, 2].argmax()][None, None].astype(np.float32), 4, 0)
    held = replace(observed(whole), controllers=hand)
    assert not len(underside(held, whole))
    assert body_of(held, "solid").points[:, 2].min() > 0.09
    # a camera above sees its upper side, which may as well lie there
    upper = whole[(ways @ turned.T)[:, 2] > 0.0]
    assert len(underside(replace(observed(upper), controllers=hand), upper))
