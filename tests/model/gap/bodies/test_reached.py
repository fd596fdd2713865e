"""A body reaches the hand that holds it from afar, and no other body is changed by that."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies import body as bodies
from model.gap.bodies.body import body_of
from model.gap.bodies.reached import held_from_afar
from model.gap.plain import PlainTwin
from model.types import Observation


def still(places, controllers, frames=60):
    """Nothing moves."""
    hands = np.asarray(controllers, np.float32).reshape(-1, 3)
    points = np.asarray(places, np.float32)
    return Observation(
        np.arange(frames) / 30.0, np.repeat(points[None], frames, 0), np.repeat(hands[None], frames, 0)
    )


def test_the_body_reaches_from_the_tip_to_the_clamp(cantilever):
    seen = cantilever()
    body = body_of(seen)
    assert body.shape == "solid"
    assert body.points[:, 0].min() == pytest.approx(-0.1 - 0.25 * 0.042, abs=0.01)
    assert body.points[:, 0].max() == pytest.approx(0.0, abs=0.01)
    assert 40 < len(body.points) <= 110
    bound = (body.weight[..., None] * body.points[body.index]).sum(1)
    np.testing.assert_allclose(bound, seen.points[0], atol=6e-4)


def test_the_hand_holds_the_whole_end_and_not_the_other(cantilever):
    seen = cantilever()
    body = body_of(seen)
    held = PlainTwin.of(body, seen).body.grip[:, 1]
    end = np.flatnonzero(body.points[:, 0] < -0.09)
    assert len(end) >= 9
    assert set(end) <= set(held)
    assert body.points[held, 0].max() < -0.03


def test_it_is_as_heavy_at_one_end_as_at_the_other(cantilever):
    body = body_of(cantilever())
    along = body.points[:, 0] - body.points[:, 0].min()
    assert body.share.sum() == pytest.approx(1.0)
    assert (body.share * along).sum() == pytest.approx(along.max() / 2, rel=0.02)
    # of a uniform bar a third of the length squared; lumped at points it is a little more
    assert (body.share * along**2).sum() == pytest.approx(along.max() ** 2 / 3, rel=0.04)


def test_it_is_the_same_body_wherever_it_is_and_however_it_is_turned_about_the_vertical(cantilever):
    seen = cantilever()
    turn, shift = Rotation.from_euler("z", 0.7), np.array([1.0, -2.0, 0.5])
    moved = replace(
        seen,
        points=(turn.apply(seen.points.reshape(-1, 3)) + shift).reshape(seen.points.shape).astype(np.float32),
        controllers=(turn.apply(seen.controllers.reshape(-1, 3)) + shift)
        .reshape(seen.controllers.shape)
        .astype(np.float32),
    )
    here, there = body_of(seen), body_of(moved)
    np.testing.assert_allclose(turn.apply(here.points) + shift, there.points, atol=1e-5)
    np.testing.assert_array_equal(here.springs, there.springs)


def test_a_bar_that_hangs_reaches_upwards(cantilever):
    seen = cantilever()
    down = Rotation.from_euler("y", np.pi / 2)
    turned = replace(
        seen,
        points=down.apply(seen.points[0]).astype(np.float32)[None].repeat(120, 0),
        controllers=down.apply(seen.controllers[0]).astype(np.float32)[None].repeat(120, 0),
    )
    body = body_of(turned)
    assert np.ptp(body.points[:, 2]) == pytest.approx(0.11, abs=0.01)


def test_markers_in_a_plane_make_a_bar_of_some_thickness(cantilever):
    seen = cantilever()
    points, hands = seen.points.copy(), seen.controllers.copy()
    points[..., 2] -= points[:1, :, 2]
    hands[..., 2] = 0.0
    body = body_of(replace(seen, points=points, controllers=hands))
    assert np.ptp(body.points[:, 2]) == pytest.approx(0.25 * np.ptp(body.points[:, 1]), rel=0.05)


def test_who_falls_is_held_by_nobody(cantilever):
    seen = cantilever()
    assert held_from_afar(seen, seen.points[0].astype(np.float64))
    fallen = seen.points.copy()
    fallen[..., 2] -= 0.5 * 9.81 * seen.times[:, None] ** 2
    assert not held_from_afar(replace(seen, points=fallen), fallen[0].astype(np.float64))
    lying = replace(seen, ground_height=float(seen.points[..., 2].min()) - 0.001)
    assert not held_from_afar(lying, seen.points[0].astype(np.float64))


def test_between_two_hands_nothing_is_reached():
    """Both are far from the markers, one on each side."""
    seen = still(0.02 * np.eye(3), [[0.15, 0.0, 0.0], [-0.15, 0.0, 0.0]])
    assert not held_from_afar(seen, seen.points[0].astype(np.float64))
    one = replace(seen, controllers=seen.controllers[:, :1])
    assert held_from_afar(one, one.points[0].astype(np.float64))


def ordinary():
    """Objects as most recordings show them, with hands near them, far from them or not at all."""
    line = np.stack([np.linspace(0, 1, 9), 0.1 * np.sin(np.linspace(0, 3, 9)), np.zeros(9)], -1)
    u, v = np.meshgrid(np.linspace(0, 0.3, 9), np.linspace(0, 0.24, 8), indexing="ij")
    cloth = np.stack([u, 0.02 * np.sin(20 * u), v], -1).reshape(-1, 3)
    ball = np.random.default_rng(0).normal(size=(120, 3))
    ball *= 0.1 / np.linalg.norm(ball, axis=1, keepdims=True)
    yield "a rope of markers, both ends held", line, [line[0] - [0.1, 0, 0], line[-1] + [0.1, 0, 0]]
    yield "three markers in a row, the hand far off", line[:3] * 0.2, [[0.3, 0, 0]]
    yield "a corner of few markers, the hand near it", np.eye(3) * 0.05, [[0.06, 0.0, 0.0]]
    yield "few markers, nothing holds them", np.eye(3) * 0.05, []
    yield "a cloth by its corner", cloth, [cloth[0] + [0, 0, 0.02]]
    yield "a cloth, the hand far off", cloth, [[0.15, 0.0, 0.5]]
    yield "a ball, the hand upon it", ball, [[0.0, 0.0, 0.11]]
    yield "a ball, the hand far off", ball, [[0.0, 0.0, 0.6]]


@pytest.mark.parametrize(("name", "places", "hands"), list(ordinary()))
def test_other_bodies_are_what_they_were(name, places, hands, monkeypatch):
    seen = still(places, hands)
    now = body_of(seen)
    monkeypatch.setattr(bodies, "held_from_afar", lambda *_: False)
    before = body_of(seen)
    for key in ("points", "springs", "share", "index", "weight", "grip"):
        np.testing.assert_array_equal(getattr(now, key), getattr(before, key))
    assert (now.shape, now.spacing, now.hold) == (before.shape, before.spacing, None)
